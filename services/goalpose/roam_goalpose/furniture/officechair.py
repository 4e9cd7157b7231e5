"""Office chairs: a padded seat on a star foot, a back on a spine, armrests and headrest at times."""

from __future__ import annotations

import numpy as np

from roam_goalpose.furniture import backs, chair, legs, seats
from roam_goalpose.furniture.dice import Dice
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.solids import Box, Pillow, Solid, Tube, turn_x, vector


def build(dice: Dice) -> Furniture:
    """An office chair."""
    top = dice.between(0.40, 0.54)
    if dice.chance(0.25):
        solids, seat = chair.shell_chair(dice, top)
        return Furniture(
            "officechair", (solids[0], *legs.star_foot(dice, top - 0.02, reach=dice.between(0.24, 0.34))), seat
        )
    hx, hz = dice.between(0.21, 0.28), dice.between(0.21, 0.27)
    thick = dice.between(0.04, 0.12)
    space = backs.BackSpace(
        hx * dice.between(0.7, 1.0),
        -hz - 0.01,
        top + dice.between(0.0, 0.14),
        top + dice.between(0.4, 0.72),
        dice.between(0.05, 0.25),
        dice.between(0.03, 0.11),
    )
    solids = seats.seat_plate(dice, hx, hz, top, thick, round_share=0.05)
    solids += backs.padded(dice, space) if dice.chance(0.6) else [backs.curved(dice, space)]
    spine = np.stack(
        [vector(0, top - thick, 0), vector(0, top - thick, space.z - 0.04), space.at(0, 0.4, -space.thickness / 2)]
    )
    solids.append(Tube(path=spine, radius=dice.between(0.014, 0.03)))
    if dice.chance(0.65):
        solids += office_arms(dice, hx, top)
    if dice.chance(0.2):
        half = vector(space.hx * 0.6, 0.04, 0.08)
        solids.append(Pillow(center=space.at(0, 1.12), half=half, rotation=space.rotation @ turn_x(np.pi / 2)))
    solids += legs.star_foot(dice, top - thick * 0.8, reach=dice.between(0.26, 0.36))
    return Furniture("officechair", tuple(solids), vector(0, top, 0)[None])


def office_arms(dice: Dice, hx: float, top: float) -> list[Solid]:
    """T-shaped or looped armrests from under the seat."""
    rise, x, looped = dice.between(0.16, 0.26), hx + dice.between(0.02, 0.07), dice.chance(0.5)
    solids: list[Solid] = []
    for side in (-1, 1):
        under, out = vector(side * hx * 0.6, top - 0.05, -0.02), vector(side * x, top - 0.03, -0.02)
        high = vector(side * x, top + rise, -0.02)
        path = [under, out, high]
        if looped:
            path = [under, out, vector(side * x, top + rise, 0.16), vector(side * x, top + rise, -0.16), out]
        solids.append(Tube(path=np.stack(path), radius=0.016))
        solids.append(Box(center=high, half=vector(0.03, 0.014, 0.14), radius=0.012))
    return solids
