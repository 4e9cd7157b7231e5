"""Lying down: one sits on the furniture's edge first, and a planned way leads from there into the pose.

Where to stand depends on the lying pose's open side. That is the one asked for, else the one where no back rest or
headboard is in the way, else the one where the furniture ends sooner (a back rest is on the other), else the one that
the character is on.

Lengths are for legs of 0.82 m (see proportions.py) and, where no source stands beside them, tuned by hand on the
approaches of `roam evaluate motion`.
"""

from functools import lru_cache

import numpy as np
import torch
from roam_character.volume import Volume

from roam_motion.actions import LIE
from roam_motion.animation.collision import furniture_of
from roam_motion.animation.figure import Figure
from roam_motion.animation.proportions import size
from roam_motion.control.actions.reclining import reclining_of, way_of
from roam_motion.control.intent import Goal
from roam_motion.control.paths import Outline, Place, edge
from roam_motion.control.seat import Posture, Seat, Transition, depths_of, floor_frame, pair, posture, rectangle

_ASIDE = 0.38  # [m] standing place beside the lying hips, at least
_UPRIGHT = 45.0  # [degrees] trunk from the vertical; 477 lying goal poses: 30 to 103, half of them over 87
_LEGS_HANG = 0.5  # [leg lengths] ankles under the hips; the same poses: -0.17 to 0.44, 95 % of sitting ones over 0.49
_CALVES = 0.16  # [m] standing place in front of the furniture's edge, as for sitting
_LOPSIDED = 0.10  # [m] difference between the furniture's two sides that tells where its back is
_WALL = 0.12, 0.2, 0.28  # [m] over lying hips: nothing that one sits down or climbs across
_WALL_STEP = 0.06  # [m] between the places that are looked at: no board is so thin that it is overlooked
_ROOM = 0.15  # [m] kept clear around a lying pose


class Lie:
    """See `GoalAction`."""

    def seat(self, figure: Figure, goal: Goal, place: Place) -> Seat:
        """The lying pose; one stands at its open side, seen from `place` where both are alike."""
        x, z, dx, dz = map(float, posture(figure, goal)[2])
        if goal.approach is not None:
            towards = float(dz * goal.approach[0] - dx * goal.approach[1])
        else:
            towards = _open_side(figure, goal) or dz * (place[0] - x) - dx * (place[1] - z)
        return _lying(figure, goal, 1.0 if towards >= 0 else -1.0)

    def objection(self, posture: Posture) -> str | None:
        """Nobody lies with an upright trunk and hanging legs."""
        if posture.trunk < _UPRIGHT and posture.hang > _LEGS_HANG:
            return f"the pose sits (trunk {posture.trunk:.0f} degrees from upright, legs down); ask for SIT"
        return None

    def room(self, figure: Figure, goal: Goal) -> Outline:
        """A rectangle around all joints."""
        origin, axes, flat = floor_frame(figure, goal)
        room = _ROOM * size(figure)
        (left, back), (right, front) = flat.min(0) - room, flat.max(0) + room
        return rectangle(origin, axes, (left, back), (right, front))

    def footing(self, figure: Figure, seat: Seat) -> None:
        """None: feet do not stand in a lying pose."""
        return None

    def transition(self, figure: Figure, seat: Seat, manner: tuple[float, ...]) -> Transition:
        """From a seat on the furniture's edge; see reclining.py."""
        return reclining_of(figure, seat, way_of(manner))


@lru_cache(maxsize=512)
def _open_side(figure: Figure, goal: Goal) -> float:
    """Positive where one lies down from the body's left, negative from its right, 0 where it is all the same."""
    positions, _, root = posture(figure, goal)
    sides = [sign * np.array([root[3], -root[2]], np.float32) for sign in (1, -1)]
    left, right = (edge(pair(root[:2]), pair(side), goal.obstacles) for side in sides)
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
def _lying(figure: Figure, goal: Goal, left: float) -> Seat:
    """With the standing place square to the body, on its left (1) or right (-1)."""
    positions, orientations, root = posture(figure, goal)
    side = left * np.array([root[3], -root[2]], np.float32)
    scale = size(figure)
    ahead = max(_ASIDE * scale, edge(pair(root[:2]), pair(side), goal.obstacles) + _CALVES * scale)
    stand = np.concatenate([root[:2] + ahead * side, side]).astype(np.float32)
    return Seat(LIE.name, positions, orientations, root, stand, goal.volume, depths_of(figure, goal))
