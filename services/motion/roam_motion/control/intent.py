"""What a character is asked to do at a frame."""

from dataclasses import dataclass

import numpy as np
from roam_character.pose import Pose
from roam_character.volume import Volume

from roam_motion.control.paths import Outline


@dataclass(frozen=True, eq=False)
class Idle:
    """Stand where you are; get up first if seated or lying. `look_at` [3] is a place in the world to look at [m]."""

    look_at: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Steer:
    """Low-level control: a wanted velocity [2] (x, z) [m/s] and, unless it follows the velocity, a facing [2].

    `look_at` [3] is a place in the world to look at [m].
    """

    velocity: np.ndarray
    facing: np.ndarray | None = None
    action: str = "walk"
    look_at: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Goal:
    """High-level control: walk up to `pose`, take it, hold it.

    `action` is sit or lie. `approach` [2] (x, z) points from the lying pose's hips to the open side of the furniture;
    None takes the side that the character is on. `obstacles` are outlines on the floor that the way goes round, the
    furniture's own among them; without any, the room that the pose takes up is kept clear.
    `volume` is the furniture itself, which limbs stay out of on the way in and out. `look_at` [3] is a place in the
    world to look at [m].
    """

    pose: Pose
    action: str = "sit"
    approach: np.ndarray | None = None
    obstacles: tuple[Outline, ...] = ()
    volume: Volume | None = None
    look_at: np.ndarray | None = None


Intent = Idle | Steer | Goal
