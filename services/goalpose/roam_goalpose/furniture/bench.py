"""Benches: long seats for several people, with or without back and arms."""

from __future__ import annotations

import numpy as np

from roam_goalpose.furniture import arms, backs, legs, seats
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.solids import Array, Box, Solid, vector


def build(rng: Rng) -> Furniture:
    """A bench, 0.8-1.9 m wide."""
    hx, hz, top = rng.between(0.38, 0.95), rng.between(0.15, 0.26), rng.between(0.38, 0.52)
    thickness = rng.between(0.02, 0.1)
    solids = seats.seat_plate(rng, hx, hz, top, thickness, round_share=0.0)
    kind = rng.pick(["legs", "legs", "sides", "chest"])
    if kind == "legs":
        solids += legs.four_legs(rng, hx, hz, top - thickness * 0.8, rungs=0.5)
    elif kind == "sides":
        solids += _sides(rng, hx, hz, top - thickness * 0.8)
    else:
        solids += legs.plinth(rng, hx, hz, top - thickness * 0.8)
    if rng.chance(0.45):
        space = backs.BackSpace(
            hx, -hz, top - 0.02, top + rng.between(0.25, 0.52), rng.between(0, 0.3), rng.between(0.015, 0.06)
        )
        solids += backs.any_back(rng, space)
        if rng.chance(0.5):
            solids += arms.thin_arms(rng, hx, hz, top, rise=rng.between(0.14, 0.24), back_z=-hz)
    elif rng.chance(0.2):
        solids += [Box(center=vector(k * hx, top + 0.06, 0), half=vector(0.02, 0.1, hz)) for k in (-1, 1)]
    return Furniture("bench", tuple(solids), places(hx, top))


def _sides(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """Two closed side boards and a stretcher or shelf."""
    half = rng.between(0.012, 0.03)
    inset = rng.between(0.0, 0.15) * hx
    boards: list[Solid] = [
        Box(center=vector(k * (hx - half - inset), top / 2, 0), half=vector(half, top / 2, hz * 0.95)) for k in (-1, 1)
    ]
    level, deep = top * rng.between(0.2, 0.7), hz * rng.between(0.1, 0.9)
    return [*boards, Box(center=vector(0, level, 0), half=vector(hx - inset, 0.012, deep))]


def places(hx: float, top: float, *, z: float = 0.0) -> Array:
    """Seat points `[K, 3]` side by side, about 0.6 m each."""
    count = max(1, round(2 * hx / 0.62))
    x = (np.arange(count) + 0.5) / count * 2 * hx - hx
    return np.stack([x, np.full(count, top), np.full(count, z)], -1)
