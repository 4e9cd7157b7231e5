"""Beds: mattress, frame, head and foot boards, posts, pillows, blankets."""

from __future__ import annotations

import numpy as np

from roam_goalpose.furniture import backs, legs
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.solids import Box, Pillow, Solid, vector


def build(rng: Rng) -> Furniture:
    """A bed, head at −Z; one sits on its long sides or foot end and lies along −Z."""
    hx, hz, top = (
        rng.pick([rng.between(0.4, 0.6), rng.between(0.65, 1.02)]),
        rng.between(0.92, 1.1),
        rng.between(0.28, 0.66),
    )
    pad = rng.between(0.1, 0.3)
    mattress = Box(
        center=vector(0, top - pad / 2, 0),
        half=vector(hx * 0.97, pad / 2, hz * 0.98),
        radius=pad * rng.between(0.05, 0.45),
    )
    solids: list[Solid] = [mattress, *_frame(rng, hx, hz, top - pad * rng.between(0.3, 0.95))]
    if rng.chance(0.85):
        space = backs.BackSpace(
            hx,
            -hz,
            rng.pick([0.0, 0.2]),
            top + rng.between(0.08, 0.65),
            rng.between(0, 0.08),
            rng.between(0.03, 0.12),
        )
        solids += backs.any_back(rng, space)
    if rng.chance(0.35):
        solids += backs.any_back(
            rng,
            backs.BackSpace(hx, hz, rng.pick([0.0, 0.2]), top + rng.between(-0.05, 0.3), 0.0, rng.between(0.03, 0.1)),
        )
    if rng.chance(0.25):
        solids += _posts(rng, hx, hz, top)
    solids += _pillows(rng, hx, hz, top)
    if rng.chance(0.4):
        length = hz * rng.between(0.5, 0.8)
        solids.append(
            Box(center=vector(0, top - 0.1, hz - length + 0.02), half=vector(hx * 1.02, 0.125, length), radius=0.03)
        )
    side = vector(hx * 0.75, top, 0.0)
    seats = np.stack([side * vector(-1, 1, 1), side, vector(0, top, hz * 0.8)])
    return Furniture("bed", tuple(solids), seats, np.array([[0, top, 0.85], [0, top, -0.85]]))


def _frame(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    if rng.chance(0.5):
        return legs.plinth(rng, hx, hz, max(top, 0.1))
    depth = min(rng.between(0.05, 0.2), top * 0.6)
    board = Box(center=vector(0, top - depth / 2, 0), half=vector(hx, depth / 2, hz))
    thick, power = rng.between(0.02, 0.05), rng.pick([2.0, 40.0])
    feet = legs.corners(hx - thick, hz - thick)
    return [
        board,
        *[
            legs.post(f, h + vector(0, top - depth / 2, 0), foot_half=thick, head_half=thick, power=power)
            for f, h in feet
        ],
    ]


def _posts(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    half, head, foot = rng.between(0.025, 0.06), top + rng.between(0.1, 0.6), top + rng.between(0.0, 0.4)
    return [
        Box(center=vector(x * hx, high / 2, z * hz), half=vector(half, high / 2, half))
        for x in (-1, 1)
        for z, high in ((-1, head), (1, foot))
    ]


def _pillows(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    count = 0 if rng.chance(0.2) else (1 if hx < 0.62 else 2)
    half = vector(min(hx / max(count, 1) * 0.85, 0.36), rng.between(0.04, 0.09), rng.between(0.15, 0.25))
    z = -hz + half[2] + rng.between(0.05, 0.12)
    return [
        Pillow(center=vector((2 * k + 1 - count) * hx / count, top + half[1] * 0.7, z), half=half) for k in range(count)
    ]
