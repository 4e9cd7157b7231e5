"""What a character is asked to do at a frame."""

from dataclasses import dataclass, replace

import numpy as np
from roam_character.pose import Pose
from roam_character.volume import Volume

from roam_motion.control.paths import Outline


@dataclass(frozen=True)
class Idle:
    """Stand where you are; get up first if seated or lying."""


@dataclass(frozen=True, eq=False)
class Steer:
    """Low-level control: a wanted velocity [2] (x, z) [m/s] and, unless it follows the velocity, a facing [2]."""

    velocity: np.ndarray
    facing: np.ndarray | None = None
    action: str = "walk"


@dataclass(frozen=True, eq=False)
class Goal:
    """High-level control: walk up to `pose`, take it, hold it.

    `action` is sit or lie. `approach` [2] (x, z) points from the lying pose's hips to the open side of the furniture;
    None takes the side that the character is on. `obstacles` are outlines on the floor that the way goes round, the
    furniture's own among them; without any, the room that the pose takes up is kept clear.
    `volume` is the furniture itself, which limbs stay out of on the way in and out.
    """

    pose: Pose
    action: str = "sit"
    approach: np.ndarray | None = None
    obstacles: tuple[Outline, ...] = ()
    volume: Volume | None = None

    def moved(self, offset: np.ndarray) -> "Goal":
        """The same goal, its pose and furniture higher or lower; `offset` [3] [m] with x and z 0."""
        volume = None if self.volume is None else self.volume.moved(offset)
        return replace(self, pose=self.pose.moved(offset), volume=volume)


Intent = Idle | Steer | Goal
