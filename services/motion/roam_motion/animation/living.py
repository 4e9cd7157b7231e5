"""Living idle: the breath and the small shifts of a body that stands or sits still.

Only the shown frame is touched, never the state that the next step starts from. Trunk and head turn about their own
axes by a degree or two; the arms keep their directions, so that hands rest where they rest. The clock alone decides,
and it starts where the character's seed put it: the same seed breathes alike.
"""

import math
from functools import cache

import torch
from torch import Tensor

from roam_motion.actions import IDLE
from roam_motion.animation.figure import Figure, turn_about
from roam_motion.animation.state import STYLE, Characters

_BREATH = 3.9  # [s]
_SHIFTS = (7.3, 11.9, 17.1), (9.1, 13.7, 23.3), (6.1, 10.3, 19.9)  # [s] periods about a joint's x, y and z axis
# Degrees about the joint's left, up and forward axis: of the breath, and at most of the shifts.
_TURNS = {
    "spine": ((-0.3, 0.0, 0.0), (0.3, 0.4, 0.4)),
    "chest": ((-0.7, 0.0, 0.0), (0.5, 0.8, 0.7)),
    "upperChest": ((-1.1, 0.0, 0.0), (0.6, 1.2, 0.8)),
    "neck": ((-0.5, 0.0, 0.0), (0.8, 2.5, 0.6)),
    "head": ((-0.2, 0.0, 0.0), (1.6, 5.0, 0.8)),
    "leftShoulder": ((0.0, 0.0, 1.2), (0.0, 0.0, 0.0)),
    "rightShoulder": ((0.0, 0.0, -1.2), (0.0, 0.0, 0.0)),
}
_OF_BREATH, _OF_SHIFTS = torch.deg2rad(torch.tensor(list(_TURNS.values()))).unbind(1)  # [K, 3] [rad]
_RATES = 2 * math.pi / torch.tensor(_SHIFTS)  # [3, 3] [rad/s]


def stillness(characters: Characters) -> Tensor:
    """How much of the living idle shows [B]: all of it in a held pose and when standing, none on the way."""
    return torch.maximum(characters.settled, characters.past[:, -1, STYLE.start + IDLE.column]).clamp(0.0, 1.0)


@cache
def _joints(figure: Figure) -> Tensor:
    return torch.tensor(figure.skeleton.indices(list(_TURNS)))


def alive(figure: Figure, orientations: Tensor, share: Tensor, clock: Tensor) -> Tensor:
    """World orientations [B, J, 3, 3] with a `share` [B] of the living idle at `clock` [B] [s]."""
    joints = _joints(figure)
    angles = _breath(clock)[:, None, None] * _OF_BREATH + _shift(clock)[:, None] * _OF_SHIFTS
    turns = turn_about(share[:, None, None] * angles)
    return orientations.index_copy(1, joints, orientations[:, joints] @ turns)


def _breath(clock: Tensor) -> Tensor:
    """-1 breathed out .. 1 breathed in [B]; in is quicker than out."""
    phase = clock * (2 * math.pi / _BREATH)
    return torch.sin(phase + 0.35 * torch.sin(phase))


def _shift(clock: Tensor) -> Tensor:
    """Slow wandering between -1 and 1 about three axes [B, 3]."""
    return torch.sin(clock[:, None, None] * _RATES).mean(-1)
