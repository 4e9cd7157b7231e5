"""Sitting down: the motion model finds the way by itself.

The paper sets the walking goal 0.3 m in front of the goal feet. In the captured sits people stand *over* their later
feet when they begin (median 0.00 m), so the standing place has their feet there already; farther away where the
furniture's edge would be in the calves, nearer where the hips would sink with nothing under them. The other lengths are
for legs of 0.82 m (see proportions.py), tuned by hand on the approaches of `roam evaluate motion`.
"""

from functools import lru_cache

import numpy as np
import torch

from roam_motion.actions import SIT
from roam_motion.animation.figure import Figure
from roam_motion.animation.proportions import size
from roam_motion.animation.stepping import BEHIND, pose_feet
from roam_motion.control.intent import Goal
from roam_motion.control.paths import Outline, Place, edge
from roam_motion.control.seat import Posture, Seat, ankles_of, depths_of, floor_frame, pair, posture, rectangle

_LEVEL = 70.0  # [degrees] trunk from the vertical; of 477 sitting goal poses the most reclined is at 48
_CALVES = 0.16  # [m] standing place in front of the furniture's edge
_BALANCED = 0.34  # [m] ankles before the goal's hips at most when one sits down: seated people's 0.18 / 0.25 / 0.34
_TUCK = 0.10  # [m] that feet are set down nearer to the seat than the goal has them, at most; later they step out
_STEP_BACK = 0.15  # [m] the edge moves the standing place away from the feet by this much at most
_ROOM = 0.33, 0.42, 0.12  # [m] kept clear beside and behind the hips, and up to here behind the ankles


class Sit:
    """See `GoalAction`."""

    def seat(self, figure: Figure, goal: Goal, place: Place) -> Seat:
        """The seated pose; one stands in front of it wherever one comes from."""
        return _sitting(figure, goal)

    def objection(self, posture: Posture) -> str | None:
        """Nobody sits with the trunk nearly level."""
        if posture.trunk > _LEVEL:
            return f"the pose lies (trunk {posture.trunk:.0f} degrees from upright); ask for LIE"
        return None

    def room(self, figure: Figure, goal: Goal) -> Outline:
        """A rectangle beside and behind the hips and up to the feet."""
        origin, axes, _ = floor_frame(figure, goal)
        beside, back, behind = (size(figure) * length for length in _ROOM)
        feet = float((ankles_of(figure, posture(figure, goal)[0]) - origin) @ axes[1])
        return rectangle(origin, axes, (-beside, -back), (beside, max(feet - behind, 0.1)))

    def footing(self, figure: Figure, seat: Seat) -> np.ndarray | None:
        """Feet are where the pose has them."""
        return _footing(figure, seat)

    def transition(self, figure: Figure, seat: Seat, manner: tuple[float, ...]) -> None:
        """None: people sit down in the captured motions."""
        return None


@lru_cache(maxsize=512)
def _sitting(figure: Figure, goal: Goal) -> Seat:
    positions, orientations, root = posture(figure, goal)
    hips, facing, scale = root[:2], root[2:], size(figure)
    feet = ankles_of(figure, positions) + BEHIND * scale * facing
    ahead, least = float((feet - hips) @ facing), edge(pair(hips), pair(facing), goal.obstacles) + _CALVES * scale
    balanced = max(least, (_BALANCED + BEHIND) * scale, ahead - _TUCK * scale)
    place = feet + (min(max(ahead, least), ahead + _STEP_BACK * scale, balanced) - ahead) * facing
    stand = np.concatenate([place, facing]).astype(np.float32)
    return Seat(SIT.name, positions, orientations, root, stand, goal.volume, depths_of(figure, goal))


@lru_cache(maxsize=512)
def _footing(figure: Figure, seat: Seat) -> np.ndarray | None:
    """Where both ankles belong before one sits down (x, z), and where their feet point [2, 4]: as they are in the pose.

    In front of the furniture where the pose has them under it, nearer to the seat where it has them far ahead; None
    where they do not stand on the floor.
    """
    feet = pose_feet(figure, torch.from_numpy(seat.positions)[None])[0].numpy()
    if not feet.any():
        return None
    place, facing = seat.stand[:2] - BEHIND * size(figure) * seat.stand[2:], seat.stand[2:]
    out = max(float((place - feet[:, :2].mean(0)) @ facing), -_TUCK * size(figure))
    feet[:, :2] += out * facing
    return np.asarray(feet)
