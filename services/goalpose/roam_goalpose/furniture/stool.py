"""Stools, ottomans and bar stools: seats without a back (bar stools may have a low one)."""

from __future__ import annotations

import numpy as np

from roam_goalpose.furniture import backs, chair, legs, seats
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.solids import Box, Pillow, Solid, Tube, vector


def build(rng: Rng) -> Furniture:
    """A stool of sitting height."""
    top, hx = rng.between(0.38, 0.52), rng.between(0.14, 0.34)
    hz = hx * rng.pick([1.0, 1.0, rng.between(0.6, 1.0)])
    kind = rng.pick(["plate"] * 5 + ["ottoman", "folding", "pedestal"])
    if kind == "ottoman":
        return Furniture("stool", tuple(_ottoman(rng, hx + 0.08, hz + 0.08, top)), vector(0, top, 0)[None])
    thickness = rng.between(0.02, 0.14)
    solids = seats.seat_plate(rng, hx, hz, top, thickness, round_share=0.45)
    if kind == "folding":
        solids += _folding(rng, hx, hz, top - thickness * 0.7)
    elif kind == "pedestal":
        solids += legs.pedestal(rng, top - thickness * 0.7, radius=hx * rng.between(0.8, 1.1))
    else:
        solids += legs.four_legs(rng, hx, hz, top - thickness * 0.8, rungs=0.6)
    return Furniture("stool", tuple(solids), vector(0, top, 0)[None])


def build_bar(rng: Rng) -> Furniture:
    """A bar stool, 0.6-0.85 m high, with a footrest and at times a back or a shell."""
    top, hx, hz = rng.between(0.58, 0.85), rng.between(0.15, 0.24), rng.between(0.15, 0.22)
    with_back = rng.chance(0.5)
    if with_back and rng.chance(0.3):
        solids, seat = chair.shell_chair(rng, top)
        solids = [solids[0], *_high_stand(rng, hx * 0.7, hz * 0.7, top - 0.02)]
        return Furniture("barstool", tuple(solids), seat)
    thickness = rng.between(0.02, 0.1)
    solids = seats.seat_plate(rng, hx, hz, top, thickness, round_share=0.35)
    solids += _high_stand(rng, hx, hz, top - thickness * 0.8)
    if with_back:
        space = backs.BackSpace(hx, -hz, top - 0.02, top + rng.between(0.18, 0.42), rng.between(0, 0.2), 0.025)
        solids += backs.any_back(rng, space)
    return Furniture("barstool", tuple(solids), vector(0, top, 0)[None])


def _high_stand(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    if rng.chance(0.25):
        return legs.pedestal(rng, top, radius=rng.between(0.18, 0.25))
    solids = legs.four_legs(rng, hx, hz, top, rungs=0.7)
    if rng.chance(0.6):
        angle = np.linspace(0, 2 * np.pi, 25)
        radius = float(np.hypot(hx, hz)) * 0.95
        ring = np.stack([radius * np.cos(angle), np.full(25, top * rng.between(0.3, 0.5)), radius * np.sin(angle)], -1)
        solids.append(Tube(path=ring, radius=0.012))
    return solids


def _ottoman(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    pad = rng.between(0.06, 0.2)
    cushion: Solid = Box(
        center=vector(0, top - pad / 2, 0), half=vector(hx, pad / 2, hz), radius=pad * rng.between(0.05, 0.45)
    )
    if rng.chance(0.3):
        cushion = Pillow(center=vector(0, top - pad / 2, 0), half=vector(hx, pad / 2, hz), plan=rng.between(2, 8))
    return [cushion, *legs.plinth(rng, hx, hz, top - pad * 0.7)]


def _folding(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """Two crossed frames."""
    radius = rng.between(0.01, 0.02)
    solids: list[Solid] = []
    for side in (-1, 1):
        for k in (-1, 1):
            x = side * (hx - 0.02) + k * radius
            path = np.array([(x, radius, -k * hz), (x, top, k * hz)])
            solids.append(Tube(path=path, radius=radius))
    solids += [Tube(path=np.array([(-hx, radius, k * hz), (hx, radius, k * hz)]), radius=radius) for k in (-1, 1)]
    return solids
