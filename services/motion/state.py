"""A character between two frames: small, serialisable, and stackable into one batch."""

from dataclasses import dataclass, fields

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
    def stack(states: "list[dict[str, np.ndarray]]") -> "Characters":
        """A batch from single characters' arrays."""
        return Characters(
            **{f.name: torch.from_numpy(np.stack([s[f.name] for s in states])) for f in fields(Characters)}
        )


def phase_vector(phase: Tensor) -> Tensor:
    """[...] phase in turns -> [..., 2] (sin, cos)."""
    angle = phase * (2 * torch.pi)
    return torch.stack([angle.sin(), angle.cos()], -1)
