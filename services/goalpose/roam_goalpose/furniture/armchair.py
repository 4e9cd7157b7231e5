"""Armchairs: thin-armed chairs, upholstered blocks, tubs and barrels, wing chairs, buckets."""

from __future__ import annotations

import numpy as np

from roam_goalpose.furniture import arms, backs, chair, legs, seats
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.sheets import Wall
from roam_goalpose.furniture.solids import Array, Box, Loft, Pillow, Solid, Tube, vector


def build(rng: Rng) -> Furniture:
    """One of the armchair kinds."""
    kind = rng.pick([open_arms, open_arms, upholstered, upholstered, barrel, hooped, bucket])
    solids, seat = kind(rng)
    return Furniture("armchair", tuple(solids), seat)


def open_arms(rng: Rng) -> tuple[list[Solid], Array]:
    """A chair or low easy chair with thin armrests."""
    top = rng.between(0.32, 0.50)
    hx, hz = rng.between(0.22, 0.33), rng.between(0.21, 0.31)
    thickness = rng.pick([rng.between(0.015, 0.04), rng.between(0.05, 0.15)])
    space = chair.back_space(rng, hx, hz, top)
    solids = seats.seat_plate(rng, hx, hz, top, thickness, round_share=0.05)
    solids += backs.any_back(rng, space)
    solids += arms.thin_arms(rng, hx, hz, top, rise=rng.between(0.14, 0.26), back_z=space.z - space.lean * 0.2)
    solids += chair.stand(rng, hx, hz, top - thickness * 0.8)
    return solids, vector(0, top, 0)[None]


def bucket(rng: Rng) -> tuple[list[Solid], Array]:
    """A shell whose sides rise into arms."""
    return chair.shell_chair(rng, rng.between(0.36, 0.5), arms=True)


def upholstered(rng: Rng) -> tuple[list[Solid], Array]:
    """Block armchairs with thick arms, cushion and back; wings and a footrest at times."""
    hx, hz = rng.between(0.24, 0.36), rng.between(0.25, 0.36)
    top, arm = rng.between(0.34, 0.50), rng.between(0.07, 0.24)
    solids = seat_block(rng, hx, hz, top)
    high = top + rng.between(0.3, 0.68)
    thick = rng.between(0.08, 0.24)
    space = backs.BackSpace(
        hx + arm * rng.pick([0.0, 0.5, 1.0]), -hz - thick * 0.2, top - 0.1, high, rng.between(0, 0.35), thick
    )
    solids += backs.padded(rng, space)
    arm_top = top + rng.between(0.1, 0.28)
    low = rng.pick([0.02, 0.06, top - 0.2])
    solids += arms.thick_arms(rng, hx, (-hz - thick * 0.4, hz), max(low, 0.0), arm_top, thickness=arm)
    if rng.chance(0.3):
        solids.append(_loose_pillow(rng, space, hx))
    if rng.chance(0.15):
        solids += _wings(rng, space)
    return solids, vector(0, top, 0.0)[None]


def seat_block(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """A cushion on a base with plinth, feet or four legs."""
    cushion = rng.between(0.08, 0.2)
    rounded = rng.between(0.01, 0.45) * cushion
    middle = vector(0, top - cushion / 2, 0)
    pad: Solid = Box(center=middle, half=vector(hx, cushion / 2, hz), radius=rounded)
    if rng.chance(0.35):
        pad = Pillow(
            center=middle, half=vector(hx, cushion / 2, hz), plan=rng.between(5, 9), profile=rng.between(2.5, 5)
        )
    if rng.chance(0.65):
        return [pad, *legs.plinth(rng, hx, hz, top - cushion * 0.8)]
    base = Box(center=vector(0, top - cushion, 0), half=vector(hx, cushion * 0.4, hz))
    return [pad, base, *legs.four_legs(rng, hx, hz, top - cushion, rungs=0.1)]


def _loose_pillow(rng: Rng, space: backs.BackSpace, hx: float) -> Solid:
    half = vector(hx * rng.between(0.5, 0.95), 0.05, rng.between(0.14, 0.22))
    from_back = space.thickness / 2 + 0.04
    rotation = space.rotation @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], dtype=float)
    return Pillow(center=space.at(0, 0.5, from_back), half=half, rotation=rotation, plan=4.0)


def _wings(rng: Rng, space: backs.BackSpace) -> list[Solid]:
    half = vector(0.03, space.length * 0.25, rng.between(0.06, 0.12))
    return [
        Box(center=space.at(k * space.hx, 0.72, half[2]), half=half, rotation=space.rotation, radius=0.028)
        for k in (-1, 1)
    ]


def barrel(rng: Rng) -> tuple[list[Solid], Array]:
    """A tub: a round wall as back and arms, around a round cushion."""
    hx, hz = rng.between(0.24, 0.36), rng.between(0.24, 0.34)
    top = rng.between(0.36, 0.48)
    thick, padded = rng.between(0.015, 0.14), rng.between(0.06, 0.16)
    low = rng.pick([0.0, 0.05, top - padded, top - 0.02])
    rise = rng.between(0.2, 0.48)
    wall = Wall(
        radius=vector(hx + thick / 2, hz + thick / 2),
        thickness=thick,
        sweep=rng.between(1.4, 2.5),
        bottom=low,
        top=vector(top + rise, top + rise * rng.between(0.3, 0.9)),
        lean=rng.between(0.0, 0.25),
        fall=rng.between(0.7, 2.0),
    )
    half = np.array([[hx, hz], [hx, hz], [hx * 0.96, hz * 0.96]])
    cushion = Loft(heights=np.array([top - padded, top - 0.02, top]), half=half, power=2.0 + rng.between(0, 1.5))
    base = (
        legs.pedestal(rng, top - padded, radius=0.24)
        if rng.chance(0.2)
        else legs.four_legs(rng, hx * 0.75, hz * 0.75, top - padded * 0.8)
    )
    if low < 0.1:
        base = [Loft(heights=np.array([low, top - padded]), half=np.array([[hx, hz], [hx, hz]]), power=2.0), *base]
    return [wall, cushion, *base], vector(0, top, 0.0)[None]


def hooped(rng: Rng) -> tuple[list[Solid], Array]:
    """A seat with a bent rail that is back and armrest in one, on sticks; Vienna and captain's chairs."""
    top, hx, hz = rng.between(0.42, 0.5), rng.between(0.22, 0.28), rng.between(0.21, 0.26)
    rise, sweep = rng.between(0.2, 0.34), rng.between(1.3, 2.0)
    thickness = rng.between(0.02, 0.06)
    solids = seats.seat_plate(rng, hx, hz, top, thickness, round_share=0.5)
    solids += legs.four_legs(rng, hx, hz, top - thickness * 0.8)
    angle = np.linspace(-sweep, sweep, 17)
    drop = rng.between(0.0, 0.08) * (np.abs(angle) / sweep) ** 2
    rail = np.stack([np.sin(angle) * (hx + 0.03), top + rise - drop, -np.cos(angle) * (hz + 0.04)], -1)
    flat = rng.chance(0.4)
    if flat:
        radius = vector(hx + 0.03, hz + 0.04)
        band = rng.between(0.05, 0.16)
        solids.append(
            Wall(
                radius=radius,
                thickness=0.025,
                sweep=sweep,
                bottom=top + rise - band,
                top=vector(top + rise, top + rise),
            )
        )
    else:
        solids.append(Tube(path=rail, radius=rng.between(0.012, 0.02)))
    for k in np.linspace(0, 16, rng.count(3, 9)).astype(int):
        foot = rail[k] * vector(0.9, 0, 0.9) + vector(0, top - thickness / 2, 0)
        solids.append(Tube(path=np.stack([foot, rail[k]]), radius=0.009))
    return solids, vector(0, top, 0.0)[None]
