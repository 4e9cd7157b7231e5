"""Armchairs: thin-armed chairs, upholstered blocks, tubs and barrels, wing chairs, buckets."""

from __future__ import annotations

import numpy as np

from roam_goalpose.furniture import arms, backs, chair, legs, seats
from roam_goalpose.furniture.dice import Dice
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.sheets import Wall
from roam_goalpose.furniture.solids import Array, Box, Loft, Pillow, Solid, Tube, vector


def build(dice: Dice) -> Furniture:
    """One of the armchair kinds."""
    kind = dice.pick([open_arms, open_arms, upholstered, upholstered, barrel, hooped, bucket])
    solids, seat = kind(dice)
    return Furniture("armchair", tuple(solids), seat)


def open_arms(dice: Dice) -> tuple[list[Solid], Array]:
    """A chair or low easy chair with thin armrests."""
    top = dice.between(0.32, 0.50)
    hx, hz = dice.between(0.22, 0.33), dice.between(0.21, 0.31)
    thickness = dice.pick([dice.between(0.015, 0.04), dice.between(0.05, 0.15)])
    space = chair.back_space(dice, hx, hz, top)
    solids = seats.seat_plate(dice, hx, hz, top, thickness, round_share=0.05)
    solids += backs.any_back(dice, space)
    solids += arms.thin_arms(dice, hx, hz, top, rise=dice.between(0.14, 0.26), back_z=space.z - space.lean * 0.2)
    solids += chair.stand(dice, hx, hz, top - thickness * 0.8)
    return solids, vector(0, top, 0)[None]


def bucket(dice: Dice) -> tuple[list[Solid], Array]:
    """A shell whose sides rise into arms."""
    return chair.shell_chair(dice, dice.between(0.36, 0.5), arms=True)


def upholstered(dice: Dice) -> tuple[list[Solid], Array]:
    """Block armchairs with thick arms, cushion and back; wings and a footrest at times."""
    hx, hz = dice.between(0.24, 0.36), dice.between(0.25, 0.36)
    top, arm = dice.between(0.34, 0.50), dice.between(0.07, 0.24)
    solids = seat_block(dice, hx, hz, top)
    high = top + dice.between(0.3, 0.68)
    thick = dice.between(0.08, 0.24)
    space = backs.BackSpace(
        hx + arm * dice.pick([0.0, 0.5, 1.0]), -hz - thick * 0.2, top - 0.1, high, dice.between(0, 0.35), thick
    )
    solids += backs.padded(dice, space)
    arm_top = top + dice.between(0.1, 0.28)
    low = dice.pick([0.02, 0.06, top - 0.2])
    solids += arms.thick_arms(dice, hx, (-hz - thick * 0.4, hz), max(low, 0.0), arm_top, thickness=arm)
    if dice.chance(0.3):
        solids.append(_loose_pillow(dice, space, hx))
    if dice.chance(0.15):
        solids += _wings(dice, space)
    return solids, vector(0, top, 0.0)[None]


def seat_block(dice: Dice, hx: float, hz: float, top: float) -> list[Solid]:
    """A cushion on a base with plinth, feet or four legs."""
    cushion = dice.between(0.08, 0.2)
    rounded = dice.between(0.01, 0.45) * cushion
    middle = vector(0, top - cushion / 2, 0)
    pad: Solid = Box(center=middle, half=vector(hx, cushion / 2, hz), radius=rounded)
    if dice.chance(0.35):
        pad = Pillow(
            center=middle, half=vector(hx, cushion / 2, hz), plan=dice.between(5, 9), profile=dice.between(2.5, 5)
        )
    if dice.chance(0.65):
        return [pad, *legs.plinth(dice, hx, hz, top - cushion * 0.8)]
    base = Box(center=vector(0, top - cushion, 0), half=vector(hx, cushion * 0.4, hz))
    return [pad, base, *legs.four_legs(dice, hx, hz, top - cushion, rungs=0.1)]


def _loose_pillow(dice: Dice, space: backs.BackSpace, hx: float) -> Solid:
    half = vector(hx * dice.between(0.5, 0.95), 0.05, dice.between(0.14, 0.22))
    from_back = space.thickness / 2 + 0.04
    rotation = space.rotation @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], dtype=float)
    return Pillow(center=space.at(0, 0.5, from_back), half=half, rotation=rotation, plan=4.0)


def _wings(dice: Dice, space: backs.BackSpace) -> list[Solid]:
    half = vector(0.03, space.length * 0.25, dice.between(0.06, 0.12))
    return [
        Box(center=space.at(k * space.hx, 0.72, half[2]), half=half, rotation=space.rotation, radius=0.028)
        for k in (-1, 1)
    ]


def barrel(dice: Dice) -> tuple[list[Solid], Array]:
    """A tub: a round wall as back and arms, around a round cushion."""
    hx, hz = dice.between(0.24, 0.36), dice.between(0.24, 0.34)
    top = dice.between(0.36, 0.48)
    thick, padded = dice.between(0.015, 0.14), dice.between(0.06, 0.16)
    low = dice.pick([0.0, 0.05, top - padded, top - 0.02])
    rise = dice.between(0.2, 0.48)
    wall = Wall(
        radius=vector(hx + thick / 2, hz + thick / 2),
        thickness=thick,
        sweep=dice.between(1.4, 2.5),
        bottom=low,
        top=vector(top + rise, top + rise * dice.between(0.3, 0.9)),
        lean=dice.between(0.0, 0.25),
        fall=dice.between(0.7, 2.0),
    )
    half = np.array([[hx, hz], [hx, hz], [hx * 0.96, hz * 0.96]])
    cushion = Loft(heights=np.array([top - padded, top - 0.02, top]), half=half, power=2.0 + dice.between(0, 1.5))
    base = (
        legs.pedestal(dice, top - padded, radius=0.24)
        if dice.chance(0.2)
        else legs.four_legs(dice, hx * 0.75, hz * 0.75, top - padded * 0.8)
    )
    if low < 0.1:
        base = [Loft(heights=np.array([low, top - padded]), half=np.array([[hx, hz], [hx, hz]]), power=2.0), *base]
    return [wall, cushion, *base], vector(0, top, 0.0)[None]


def hooped(dice: Dice) -> tuple[list[Solid], Array]:
    """A seat with a bent rail that is back and armrest in one, on sticks; Vienna and captain's chairs."""
    top, hx, hz = dice.between(0.42, 0.5), dice.between(0.22, 0.28), dice.between(0.21, 0.26)
    rise, sweep = dice.between(0.2, 0.34), dice.between(1.3, 2.0)
    thickness = dice.between(0.02, 0.06)
    solids = seats.seat_plate(dice, hx, hz, top, thickness, round_share=0.5)
    solids += legs.four_legs(dice, hx, hz, top - thickness * 0.8)
    angle = np.linspace(-sweep, sweep, 17)
    drop = dice.between(0.0, 0.08) * (np.abs(angle) / sweep) ** 2
    rail = np.stack([np.sin(angle) * (hx + 0.03), top + rise - drop, -np.cos(angle) * (hz + 0.04)], -1)
    flat = dice.chance(0.4)
    if flat:
        radius = vector(hx + 0.03, hz + 0.04)
        band = dice.between(0.05, 0.16)
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
        solids.append(Tube(path=rail, radius=dice.between(0.012, 0.02)))
    for k in np.linspace(0, 16, dice.count(3, 9)).astype(int):
        foot = rail[k] * vector(0.9, 0, 0.9) + vector(0, top - thickness / 2, 0)
        solids.append(Tube(path=np.stack([foot, rail[k]]), radius=0.009))
    return solids, vector(0, top, 0.0)[None]
