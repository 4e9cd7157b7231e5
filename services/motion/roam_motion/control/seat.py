"""A goal pose as the controller needs it: where it is, where one stands before it, the planned way into it."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import torch
from roam_character.pose import Pose
from roam_character.rotation import quat_to_matrix
from roam_character.volume import Volume

from roam_motion.animation.collision import goal_depths, limbs_of
from roam_motion.animation.figure import Figure
from roam_motion.control.intent import Goal
from roam_motion.control.paths import Place

_FOREARM = 4  # last samples of an arm: forearm and hand


@dataclass(frozen=True, eq=False)
class Seat:
    """A goal pose and the standing place that belongs to it."""

    action: str  # that takes it
    positions: np.ndarray  # [J, 3]
    orientations: np.ndarray  # [J, 3, 3]
    root: np.ndarray  # [4] x, z, direction
    stand: np.ndarray  # [4] where to stand before and after: x, z, direction
    volume: Volume | None = None  # the furniture
    depths: np.ndarray | None = None  # [P] how deep the pose's own limbs are in it (see collision.py) [m]

    def same_as(self, other: "Seat") -> bool:
        """Whether the pose is the same to a tenth of a millimetre."""
        return self is other or (
            self.action == other.action and bool(np.abs(self.positions - other.positions).max() < 1e-4)
        )


@dataclass(frozen=True)
class Posture:
    """How a goal pose holds its trunk and legs."""

    trunk: float  # mid-hip to neck, from the vertical [degrees]
    hang: float  # of the ankles under the hips [leg lengths]


@dataclass(frozen=True, eq=False)
class Transition:
    """A planned way from a pose that the motion model finds by itself into a goal pose, and another one back to it: T
    poses at 30 Hz, of which the first and what comes after the last are the entry pose."""

    entry: Seat
    goal: Seat
    positions: np.ndarray  # [T, J, 3] [m]
    orientations: np.ndarray  # [T, J, 3, 3]
    roots: np.ndarray  # [T, 4] x, z, direction
    last: int  # the frame that is the goal
    changes: float  # share of the way in from which the style is no longer the entry's but the goal's

    @property
    def end(self) -> int:
        """The frame that is the entry pose again."""
        return len(self.positions)

    def at(self, frame: int) -> Seat:
        """The pose of a frame, as something to be held."""
        if frame == self.last or not 0 < frame < self.end:
            return self.goal if frame == self.last else self.entry
        return replace(
            self.goal,
            positions=self.positions[frame],
            orientations=self.orientations[frame],
            root=self.roots[frame],
        )

    def lies(self, along: float) -> bool:
        """Whether so many frames along the way the goal's style is shown."""
        inwards = along / self.last if along <= self.last else (self.end - along) / (self.end - self.last)
        return inwards > self.changes


def goal_arrays(figure: Figure, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Joint positions [J, 3] and world orientations [J, 3, 3] of a pose."""
    local = quat_to_matrix(torch.tensor(np.asarray(pose.rotations, np.float32)))
    orientations = figure.world(local)
    hips = torch.tensor(np.asarray(pose.root_position, np.float32))
    return figure.positions(hips, orientations).numpy(), orientations.numpy()


@lru_cache(maxsize=512)
def posture(figure: Figure, goal: Goal) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint positions [J, 3], orientations [J, 3, 3] and root [4] (x, z, direction) of a goal's pose."""
    positions, orientations = goal_arrays(figure, goal.pose)
    frame = figure.frame(torch.from_numpy(positions)[None])
    return positions, orientations, torch.cat([frame.origin[0], frame.direction[0]]).numpy()


@lru_cache(maxsize=512)
def resting(figure: Figure, seat: Seat) -> tuple[float, float, float]:
    """Whether left hand, right hand and back rest on the furniture (1) or not (0); where it is not known they do."""
    if seat.depths is None:
        return 1.0, 1.0, 1.0
    limbs = limbs_of(figure)
    left, right = seat.depths[: 2 * limbs.arm_samples].reshape(2, -1)[:, -_FOREARM:]
    back = seat.depths[-len(limbs.trunk) :]
    return float(left.max() > 0), float(right.max() > 0), float(back.max() > 0)


def depths_of(figure: Figure, goal: Goal) -> np.ndarray | None:
    """How deep a goal pose's own limbs are in its furniture [P] [m]; None without furniture."""
    positions, orientations, _ = posture(figure, goal)
    return goal_depths(figure, positions, orientations, goal.volume) if goal.volume else None


def floor_frame(figure: Figure, goal: Goal) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A goal pose seen from above: its root [2], the axes [2, 2] to its left and ahead, joints [J, 2] along them."""
    positions, _, root = posture(figure, goal)
    axes = np.array([[root[3], -root[2]], root[2:]])
    return root[:2], axes, (positions[:, [0, 2]] - root[:2]) @ axes.T


def rectangle(
    origin: np.ndarray, axes: np.ndarray, low: tuple[float, float], high: tuple[float, float]
) -> tuple[Place, ...]:
    """The outline on the floor between two corners, which are given along `axes` [2, 2] from `origin` [2]."""
    (left, back), (right, front) = low, high
    corners = [(left, back), (right, back), (right, front), (left, front)]
    return tuple(pair(origin + np.array(corner) @ axes) for corner in corners)


def ankles_of(figure: Figure, positions: np.ndarray) -> np.ndarray:
    """Middle of the ankles on the floor [2]."""
    return np.asarray(positions[figure.contacts.numpy()[[0, 2]]][:, [0, 2]].mean(0))


def pair(point: np.ndarray) -> Place:
    """A point [2] as a place."""
    return float(point[0]), float(point[1])
