"""What a character is asked to do at a frame."""

from dataclasses import dataclass, replace

import numpy as np
from roam_character.pose import Pose
from roam_character.volume import Volume

from roam_motion.control.paths import Outline


@dataclass(frozen=True, eq=False)
class Idle:
    """Stand where you are; get up first if seated or lying. `look_at` [3] is a place in the world to look at [m].

    `around`: see `Steer`; kept for who is steered later.
    """

    look_at: np.ndarray | None = None
    around: tuple[Outline, ...] = ()


@dataclass(frozen=True, eq=False)
class Steer:
    """Low-level control: a wanted velocity [2] (x, z) [m/s] and, unless it follows the velocity, a facing [2].

    `look_at` [3] is a place in the world to look at [m]. `around` are outlines on the floor that it keeps out of.
    """

    velocity: np.ndarray
    facing: np.ndarray | None = None
    action: str = "walk"
    look_at: np.ndarray | None = None
    around: tuple[Outline, ...] = ()


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

    def moved(self, offset: np.ndarray) -> "Goal":
        """The same goal, its pose and furniture higher or lower; `offset` [3] [m] with x and z 0."""
        volume = None if self.volume is None else self.volume.moved(offset)
        return replace(self, pose=self.pose.moved(offset), volume=volume)


def raised(intent: "Intent", height: float) -> "Intent":
    """The same intent in a world whose floor is `height` [m] higher."""
    if not height:
        return intent
    offset = np.array([0, height, 0], np.float32)
    if isinstance(intent, Goal):
        intent = intent.moved(offset)
    if intent.look_at is None:
        return intent
    return replace(intent, look_at=(intent.look_at + offset).astype(np.float32))


Intent = Idle | Steer | Goal
