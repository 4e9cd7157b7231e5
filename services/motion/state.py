"""A character between two frames: small, serialisable, and stackable into one batch."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from torch import Tensor

FRAME_RATE = 30  # [Hz]
KEY_STRIDE = 5  # frames between trajectory keys: 1/6 s
PAST = 31  # frames of history: -1 s to now
FUTURE = 6  # keys after now: +1/6 s to +1 s
KEYS = 13
ACTIONS = ("idle", "walk", "sit", "lie")


@dataclass
class Characters:
    """B characters as tensors; everything in the world, metres and seconds."""

    hips: Tensor  # [B, 3]
    orientations: Tensor  # [B, J, 3, 3] world orientation of every joint
    velocities: Tensor  # [B, J, 3] [m/s]
    past: Tensor  # [B, 31, 9] root x, z, direction x, z, four style labels, phase; oldest first, now last
    future: Tensor  # [B, 6, 9] the same at the six future keys; phase counted on from now
    contacts: Tensor  # [B, 4] predicted contact, 0..1
    locks: Tensor  # [B, 4, 3] where each contact is held
    lock_weights: Tensor  # [B, 4] 0 free .. 1 held
    settled: Tensor  # [B] how far the held pose has been drawn onto the goal pose, 0..1
    blend: Tensor  # [B] the bidirectional weight in use, 0..1

    @staticmethod
    def stack(rows: Sequence[np.ndarray]) -> "Characters":
        """A batch from single characters' numbers [D]."""
        shapes = shapes_of(len(rows[0]))
        parts = torch.from_numpy(np.stack(rows)).split([math.prod(shape) for shape in shapes.values()], 1)
        return Characters(
            **{name: part.view(-1, *shape) for (name, shape), part in zip(shapes.items(), parts, strict=True)}
        )

    def rows(self) -> list[np.ndarray]:
        """The numbers of every character [D], in the order of the fields; each an array of its own."""
        parts = [part.reshape(len(self.hips), -1) for part in vars(self).values()]
        return [row.copy() for row in torch.cat(parts, 1).numpy()]


@cache
def shapes_of(width: int) -> dict[str, tuple[int, ...]]:
    """The shapes of a single character's fields that has so many numbers D = 358 + 12 J."""
    joints = (width - 358) // 12
    return {
        "hips": (3,),
        "orientations": (joints, 3, 3),
        "velocities": (joints, 3),
        "past": (PAST, 9),
        "future": (FUTURE, 9),
        "contacts": (4,),
        "locks": (4, 3),
        "lock_weights": (4,),
        "settled": (),
        "blend": (),
    }


def phase_vector(phase: Tensor) -> Tensor:
    """[...] phase in turns -> [..., 2] (sin, cos)."""
    angle = phase * (2 * torch.pi)
    return torch.stack([angle.sin(), angle.cos()], -1)
