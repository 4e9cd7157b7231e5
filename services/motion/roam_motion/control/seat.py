"""A goal pose as the controller needs it: where it is, where one stands before it, what the way there goes round.

The paper sets the walking goal 0.3 m in front of the goal feet. In the captured sits people stand *over* their later
feet when they begin (median 0.00 m), so the standing place has their feet there already, or farther away where the
furniture's edge would be in the calves.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from roam_character.pose import Pose
from roam_character.rotation import quat_to_matrix
from roam_character.volume import Volume

from roam_motion.animation.collision import furniture_of, goal_depths
from roam_motion.animation.figure import Figure
from roam_motion.animation.proportions import size
from roam_motion.animation.stepping import BEHIND, pose_feet
from roam_motion.control.intent import Goal
from roam_motion.control.paths import Outline, Place, edge

_LIE_ASIDE = 0.38  # [m] standing place beside the lying hips
_CALVES = 0.16  # [m] standing place in front of the furniture's edge
_STEP_BACK = 0.15  # [m] the edge moves the standing place away from the feet by this much at most
_SEAT_ROOM = 0.33, 0.42, 0.12  # [m] kept clear beside and behind the hips, and up to here behind the ankles
_LOPSIDED = 0.10  # [m] difference between the furniture's two sides that tells where its back is
_WALL = 0.12, 0.2, 0.28  # [m] over lying hips: nothing that one sits down or climbs across
_WALL_STEP = 0.06  # [m] between the places that are looked at: no board is so thin that it is overlooked
_LYING_ROOM = 0.15  # [m] kept clear around a lying pose


@dataclass(frozen=True, eq=False)
class Seat:
    """A goal pose and the standing place that belongs to it."""

    positions: np.ndarray  # [J, 3]
    orientations: np.ndarray  # [J, 3, 3]
    root: np.ndarray  # [4] x, z, direction
    stand: np.ndarray  # [4] where to stand before and after: x, z, direction
    lying: bool
    volume: Volume | None = None  # the furniture
    depths: np.ndarray | None = None  # [P] how deep the pose's own limbs are in it (see clearance.py) [m]

    def same_as(self, other: "Seat") -> bool:
        """Whether the pose is the same to a tenth of a millimetre."""
        return self is other or (
            self.lying == other.lying and bool(np.abs(self.positions - other.positions).max() < 1e-4)
        )


def seat_of(figure: Figure, goal: Goal, place: Place) -> Seat:
    """The seat of a goal for a character at `place`: where to stand depends on the lying pose's open side.

    That is the one asked for, else the one where no back rest or headboard is in the way, else the one where the
    furniture ends sooner (a back rest is on the other), else the one that the character is on.
    """
    if goal.action != "lie":
        return _sitting(figure, goal)
    x, z, dx, dz = map(float, _posture(figure, goal)[2])
    if goal.approach is not None:
        towards = float(dz * goal.approach[0] - dx * goal.approach[1])
    else:
        towards = _open_side(figure, goal) or dz * (place[0] - x) - dx * (place[1] - z)
    return _lying(figure, goal, 1.0 if towards >= 0 else -1.0)


@lru_cache(maxsize=512)
def _open_side(figure: Figure, goal: Goal) -> float:
    """Positive where one lies down from the body's left, negative from its right, 0 where it is all the same."""
    positions, _, root = _posture(figure, goal)
    sides = [sign * np.array([root[3], -root[2]], np.float32) for sign in (1, -1)]
    left, right = (edge(_pair(root[:2]), _pair(side), goal.obstacles) for side in sides)
    if goal.volume is not None:
        walled = [_walled(goal.volume, positions[0], *pair) for pair in zip(sides, (left, right), strict=True)]
        if walled[0] != walled[1]:
            return 1.0 if walled[1] else -1.0
    return right - left if abs(left - right) > _LOPSIDED else 0.0


def _walled(volume: Volume, hips: np.ndarray, side: np.ndarray, reach: float) -> bool:
    """Whether matter rises over lying `hips` [3] between them and the furniture's edge, `reach` [m] to a side [2]."""
    furniture = furniture_of([volume], [np.zeros(0, np.float32)], [True])
    ways, heights = np.meshgrid(np.arange(_WALL_STEP * 3, reach + _CALVES, _WALL_STEP), _WALL, indexing="ij")
    flat = ways.ravel()[:, None] * side
    points = hips + np.stack([flat[:, 0], heights.ravel(), flat[:, 1]], 1)
    if not len(points):  # the furniture ends beside the hips
        return False
    gap, _ = furniture.distance(torch.tensor(points, dtype=torch.float32)[None])
    return bool(gap.min() < 0.6 * _WALL_STEP)


@lru_cache(maxsize=512)
def outlines_of(figure: Figure, goal: Goal) -> tuple[Outline, ...]:
    """What the way to a goal goes round: its obstacles, or the room that its pose takes up."""
    return goal.obstacles or (_room(figure, goal),)


def goal_arrays(figure: Figure, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Joint positions [J, 3] and world orientations [J, 3, 3] of a pose."""
    local = quat_to_matrix(torch.tensor(np.asarray(pose.rotations, np.float32)))
    orientations = figure.world(local)
    hips = torch.tensor(np.asarray(pose.root_position, np.float32))
    return figure.positions(hips, orientations).numpy(), orientations.numpy()


@lru_cache(maxsize=512)
def _posture(figure: Figure, goal: Goal) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint positions [J, 3], orientations [J, 3, 3] and root [4] (x, z, direction) of a goal's pose."""
    positions, orientations = goal_arrays(figure, goal.pose)
    frame = figure.frame(torch.from_numpy(positions)[None])
    return positions, orientations, torch.cat([frame.origin[0], frame.direction[0]]).numpy()


@lru_cache(maxsize=512)
def _sitting(figure: Figure, goal: Goal) -> Seat:
    positions, orientations, root = _posture(figure, goal)
    hips, facing = root[:2], root[2:]
    feet = _ankles(figure, positions) + BEHIND * size(figure) * facing
    short = edge(_pair(hips), _pair(facing), goal.obstacles) + _CALVES - float((feet - hips) @ facing)
    place = feet + min(max(short, 0.0), _STEP_BACK) * facing
    stand = np.concatenate([place, facing]).astype(np.float32)
    return Seat(positions, orientations, root, stand, False, goal.volume, _depths(figure, goal))


@lru_cache(maxsize=512)
def footing(figure: Figure, seat: Seat) -> np.ndarray | None:
    """Where both ankles belong before one sits down (x, z), and where their feet point [2, 4]: as they are in the pose.

    In front of the furniture where the pose has them under it; None where they do not stand on the floor.
    """
    feet = pose_feet(figure, torch.from_numpy(seat.positions)[None])[0].numpy()
    if seat.lying or not feet.any():
        return None
    place, facing = seat.stand[:2] - BEHIND * size(figure) * seat.stand[2:], seat.stand[2:]
    out = max(float((place - feet[:, :2].mean(0)) @ facing), 0.0)
    feet[:, :2] += out * facing
    return np.asarray(feet)


@lru_cache(maxsize=512)
def _lying(figure: Figure, goal: Goal, left: float) -> Seat:
    """With the standing place square to the body, on its left (1) or right (-1)."""
    positions, orientations, root = _posture(figure, goal)
    side = left * np.array([root[3], -root[2]], np.float32)
    ahead = max(_LIE_ASIDE, edge(_pair(root[:2]), _pair(side), goal.obstacles) + _CALVES)
    stand = np.concatenate([root[:2] + ahead * side, side]).astype(np.float32)
    return Seat(positions, orientations, root, stand, True, goal.volume, _depths(figure, goal))


def _depths(figure: Figure, goal: Goal) -> np.ndarray | None:
    positions, orientations, _ = _posture(figure, goal)
    return goal_depths(figure, positions, orientations, goal.volume) if goal.volume else None


def _room(figure: Figure, goal: Goal) -> Outline:
    """The room that a pose takes up on the floor: a rectangle along its facing."""
    positions, _, root = _posture(figure, goal)
    axes = np.array([[root[3], -root[2]], root[2:]])  # to the left, ahead
    flat = (positions[:, [0, 2]] - root[:2]) @ axes.T
    if goal.action == "lie":
        (left, back), (right, front) = flat.min(0) - _LYING_ROOM, flat.max(0) + _LYING_ROOM
    else:
        beside, back, behind = _SEAT_ROOM
        feet = float((_ankles(figure, positions) - root[:2]) @ root[2:])
        left, right, back, front = -beside, beside, -back, max(feet - behind, 0.1)
    corners = [(left, back), (right, back), (right, front), (left, front)]
    return tuple(_pair(root[:2] + np.array(corner) @ axes) for corner in corners)


def _ankles(figure: Figure, positions: np.ndarray) -> np.ndarray:
    """Middle of the ankles on the floor [2]."""
    return np.asarray(positions[figure.contacts.numpy()[[0, 2]]][:, [0, 2]].mean(0))


def _pair(point: np.ndarray) -> Place:
    return float(point[0]), float(point[1])
