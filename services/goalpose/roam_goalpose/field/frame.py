"""Where up, the front and the seat's height are, as the field sees them.

The decoder says of every query how high over the seat and how far to the front it lies (`Answer.place`). Both are
linear in the query for an object that stands somewhere, turned somehow; the gradients are its up and front directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from roam_goalpose.field.decoder import Answer
from roam_goalpose.field.latent import Latent


class Answering(Protocol):
    """What is asked of the field."""

    def answer(self, latent: Latent, queries: Tensor) -> Answer:
        """Occupancy, distance and place of queries `[B, Q, 3]`."""
        ...


@dataclass(frozen=True, eq=False)
class ObjectFrame:
    """Directions and seat height of B objects, in the frame of their clouds."""

    up: Tensor
    """`[B, 3]` unit"""
    front: Tensor
    """`[B, 3]` unit, perpendicular to `up`; meaningless where `front_clarity` is near 0 (stools)"""
    front_clarity: Tensor
    """`[B]` length of the fitted front gradient: about 1 where front and back differ, near 0 on round stools"""
    seat_offset: Tensor
    """`[B]` [m]: the seat's top lies where `up · x = seat_offset`"""


MIXES = (-0.3, -0.15, 0.15, 0.5)
"""How far from one anchor towards another a query lies; negative: beyond it. Such queries turn with the object."""


@torch.no_grad()
def estimate_frame(field: Answering, latent: Latent) -> ObjectFrame:
    """Fits the decoder's places, asked between and around the anchors, with linear functions of the query."""
    anchors = latent.anchors
    mixed = [anchors + mix * (anchors.roll(k + 1, 1) - anchors) for k, mix in enumerate(MIXES)]
    offsets = torch.cat(mixed, 1)
    place = field.answer(latent, offsets + latent.center[:, None]).place
    design = torch.cat([offsets, torch.ones_like(offsets[..., :1])], -1)
    fit = torch.linalg.lstsq(design, place[..., 1:]).solution  # [B, 4, 2]
    rise, ahead = fit[:, :3, 0], fit[:, :3, 1]
    length = torch.linalg.vector_norm(rise, dim=-1, keepdim=True).clamp_min(1e-6)
    up = rise / length
    ahead = ahead - (ahead * up).sum(-1, keepdim=True) * up
    clarity = torch.linalg.vector_norm(ahead, dim=-1)
    front = ahead / clarity[:, None].clamp_min(1e-6)
    seat = (up * latent.center).sum(-1) - fit[:, 3, 0] / length[:, 0]
    return ObjectFrame(up, front, clarity, seat)
