"""Office chairs: a padded seat on a star foot, a back on a spine, armrests and headrest at times."""

from __future__ import annotations

import numpy as np

from roam_goalpose.furniture import backs, chair, legs, seats
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.solids import Box, Pillow, Solid, Tube, turn_x, vector


def build(rng: Rng) -> Furniture:
    """An office chair."""
    top = rng.between(0.40, 0.54)
    if rng.chance(0.25):
        solids, seat = chair.shell_chair(rng, top)
        return Furniture(
            "officechair", (solids[0], *legs.star_foot(rng, top - 0.02, reach=rng.between(0.24, 0.34))), seat
        )
    hx, hz = rng.between(0.21, 0.28), rng.between(0.21, 0.27)
    thick = rng.between(0.04, 0.12)
    space = backs.BackSpace(
        hx * rng.between(0.7, 1.0),
        -hz - 0.01,
        top + rng.between(0.0, 0.14),
        top + rng.between(0.4, 0.72),
        rng.between(0.05, 0.25),
        rng.between(0.03, 0.11),
    )
    solids = seats.seat_plate(rng, hx, hz, top, thick, round_share=0.05)
    solids += backs.padded(rng, space) if rng.chance(0.6) else [backs.curved(rng, space)]
    spine = np.stack(
        [vector(0, top - thick, 0), vector(0, top - thick, space.z - 0.04), space.at(0, 0.4, -space.thickness / 2)]
    )
    solids.append(Tube(path=spine, radius=rng.between(0.014, 0.03)))
    if rng.chance(0.65):
        solids += office_arms(rng, hx, top)
    if rng.chance(0.2):
        half = vector(space.hx * 0.6, 0.04, 0.08)
        solids.append(Pillow(center=space.at(0, 1.12), half=half, rotation=space.rotation @ turn_x(np.pi / 2)))
    solids += legs.star_foot(rng, top - thick * 0.8, reach=rng.between(0.26, 0.36))
    return Furniture("officechair", tuple(solids), vector(0, top, 0)[None])


def office_arms(rng: Rng, hx: float, top: float) -> list[Solid]:
    """T-shaped or looped armrests from under the seat."""
    rise, x, looped = rng.between(0.16, 0.26), hx + rng.between(0.02, 0.07), rng.chance(0.5)
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
