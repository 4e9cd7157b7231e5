"""Daybeds and seats of bare boards: a wide thin deck on a frame or on boards, rails or panels on up to three sides.

A kind of its own beside the sofas: most are upholstered, and a board a centimetre thick and two metres long is what
the descriptor field would otherwise see too rarely.
"""

from __future__ import annotations

from roam_goalpose.furniture import backs, legs
from roam_goalpose.furniture.bench import places
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.sofa import lie_line
from roam_goalpose.furniture.solids import Box, Solid, vector


def build(rng: Rng) -> Furniture:
    """A daybed or a sofa of boards, 0.9-2.4 m wide."""
    hx, hz, top = rng.between(0.45, 1.2), rng.between(0.24, 0.5), rng.between(0.3, 0.54)
    solids = _deck(rng, hx, hz, top)
    solids += _stand(rng, hx, hz, top)
    solids += _sides(rng, hx, hz, top)
    lie = lie_line(hx, top) if hx > 0.75 else None
    return Furniture("sofa", tuple(solids), places(hx, top, z=0.02), lie)


def _deck(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """The surface one sits on: one board, or a few beside each other."""
    half, count = rng.between(0.004, 0.013), rng.pick([1, 1, 1, 3, 5])
    gap = rng.between(0.0, 0.02) if count > 1 else 0.0
    step = 2 * hz / count
    return [
        Box(center=vector(0, top - half, -hz + step * (k + 0.5)), half=vector(hx, half, step / 2 - gap / 2))
        for k in range(count)
    ]


def _stand(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """Corner posts with or without a rim, legs like a chair's, or two boards."""
    kind = rng.pick(["posts", "posts", "rim", "legs", "boards"])
    if kind == "legs":
        return legs.four_legs(rng, hx, hz, top - 0.005, rungs=0.3)
    thick = rng.between(0.02, 0.06)
    if kind == "boards":
        side = vector(min(thick, 0.03) / 2, top / 2, hz * rng.between(0.7, 1.0))
        return [Box(center=vector(k * (hx - thick), top / 2, 0), half=side) for k in (-1, 1)]
    low = rng.pick([0.0, 0.0, top * 0.6])
    size = vector(thick, (top - low) / 2, thick)
    solids: list[Solid] = [
        Box(center=vector(x * (hx - thick), (top + low) / 2, z * (hz - thick)), half=size)
        for x in (-1, 1)
        for z in (-1, 1)
    ]
    if kind == "rim" or low:
        solids += _rim(rng, hx, hz, top, thick)
    if low:
        foot = vector(thick, low / 2, hz * 0.8)
        solids += [Box(center=vector(k * hx * 0.7, low / 2, 0), half=foot) for k in (-1, 1)]
    return solids


def _rim(rng: Rng, hx: float, hz: float, top: float, thick: float) -> list[Solid]:
    """Boards on edge under the deck, all around."""
    half = rng.between(0.03, 0.08)
    y = top - half
    long = [Box(center=vector(0, y, k * (hz - thick / 2)), half=vector(hx, half, thick / 2)) for k in (-1, 1)]
    short = [Box(center=vector(k * (hx - thick / 2), y, 0), half=vector(thick / 2, half, hz)) for k in (-1, 1)]
    return [*long, *short]


def _sides(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """Thin panels or a slatted back behind, panels at both ends; at times none."""
    if rng.chance(0.2):
        return []
    half, rise = rng.between(0.006, 0.018), rng.between(0.12, 0.5)
    if rng.chance(0.4):
        space = backs.BackSpace(hx, -hz, top - 0.02, top + rise, rng.between(0.0, 0.2), 2 * half)
        solids = backs.any_back(rng, space)
    else:
        solids = [Box(center=vector(0, top + rise / 2, half - hz), half=vector(hx, rise / 2, half))]
    if rng.chance(0.7):
        high = rise * rng.between(0.5, 1.0)
        gap = rng.pick([0.0, 0.0, high * 0.3])
        size = vector(half, (high - gap) / 2, hz * rng.between(0.8, 1.0))
        solids += [Box(center=vector(k * (hx - half), top + (high + gap) / 2, 0), half=size) for k in (-1, 1)]
        if gap:
            post = vector(half, high / 2, 0.02)
            solids += [
                Box(center=vector(x * (hx - half), top + high / 2, z * (hz - 0.02)), half=post)
                for x in (-1, 1)
                for z in (-1, 1)
            ]
    return solids
