"""Living idle: the breath and the small shifts of a body that stands or sits still.

Only the shown frame is touched, never the state that the next step starts from. Trunk and head turn about their own
axes by a degree or two; the arms keep their directions, so that hands rest where they rest. The clock alone decides,
and it starts where the character's seed put it: the same seed breathes alike.
"""

import math

import torch
from character.rotation import quat_from_rotvec, quat_to_matrix
from torch import Tensor

from motion.figure import Figure
from motion.state import Characters

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


def stillness(characters: Characters) -> Tensor:
    """How much of the living idle shows [B]: all of it in a held pose and when standing, none on the way."""
    return torch.maximum(characters.settled, characters.past[:, -1, 4]).clamp(0.0, 1.0)


def alive(figure: Figure, orientations: Tensor, share: Tensor, clock: Tensor) -> Tensor:
    """World orientations [B, J, 3, 3] with a `share` [B] of the living idle at `clock` [B] [s]."""
    joints = figure.skeleton.indices(list(_TURNS))
    breath, shifts = torch.tensor(list(_TURNS.values())).unbind(1)  # [K, 3] degrees
    angles = _breath(clock)[:, None, None] * breath + _shift(clock)[:, None] * shifts
    turns = quat_to_matrix(quat_from_rotvec(torch.deg2rad(share[:, None, None] * angles)))
    moved = orientations.clone()
    moved[:, joints] = orientations[:, joints] @ turns
    return moved


def _breath(clock: Tensor) -> Tensor:
    """-1 breathed out .. 1 breathed in [B]; in is quicker than out."""
    phase = clock * (2 * math.pi / _BREATH)
    return torch.sin(phase + 0.35 * torch.sin(phase))


def _shift(clock: Tensor) -> Tensor:
    """Slow wandering between -1 and 1 about three axes [B, 3]."""
    waves = torch.sin(clock[:, None, None] * (2 * math.pi / torch.tensor(_SHIFTS)))
    return waves.mean(-1)
