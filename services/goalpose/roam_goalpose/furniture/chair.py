"""Chairs: one seat, a back, no arms (or thin ones on `armchair`)."""

from __future__ import annotations

import numpy as np

from roam_goalpose.furniture import backs, legs, seats
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.sheets import Sheet, smooth_curve
from roam_goalpose.furniture.solids import Array, Solid, Tube, vector


def build(rng: Rng) -> Furniture:
    """A chair: plate and back (most), or one bent shell."""
    top = rng.between(0.40, 0.54)
    solids, seat = shell_chair(rng, top) if rng.chance(0.24) else plate_chair(rng, top)
    return Furniture("chair", tuple(solids), seat)


def plate_chair(rng: Rng, top: float) -> tuple[list[Solid], Array]:
    """Seat plate on legs with a separate back. Returns solids and the seat point `[1, 3]`."""
    hx, hz = rng.between(0.18, 0.30), rng.between(0.18, 0.28)
    thickness = rng.pick([rng.between(0.014, 0.03), rng.between(0.03, 0.06), rng.between(0.06, 0.14)])
    space = back_space(rng, hx, hz, top)
    solids = seats.seat_plate(rng, hx, hz, top, thickness)
    solids += backs.any_back(rng, space)
    solids += stand(rng, hx, hz, top - thickness * 0.8)
    if rng.chance(0.35):
        solids += rear_legs_as_posts(rng, space, top)
    return solids, vector(0, top, rng.between(-0.02, 0.03))[None]


def back_space(rng: Rng, hx: float, hz: float, top: float) -> backs.BackSpace:
    """Where a chair's back stands: height 0.28-0.62 m over the seat, upright to clearly leaning."""
    thick = rng.pick([rng.between(0.012, 0.03), rng.between(0.03, 0.09)])
    return backs.BackSpace(
        hx=hx * rng.between(0.75, 1.02),
        z=-hz + thick * 0.4,
        low=top - 0.02,
        high=top + rng.between(0.28, 0.62),
        lean=rng.between(0.0, 0.38),
        thickness=thick,
    )


def stand(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """What a chair stands on."""
    kind = rng.pick(["legs"] * 13 + ["sled"] * 4 + ["pedestal", "star", "rockers"])
    if kind == "sled":
        return legs.sled(rng, hx, hz, top)
    if kind == "pedestal":
        return legs.pedestal(rng, top, radius=rng.between(0.18, 0.28))
    if kind == "star":
        return legs.star_foot(rng, top, reach=rng.between(0.24, 0.34))
    if kind == "rockers":
        return legs.rockers(rng, hx, hz, top)
    return legs.four_legs(rng, hx, hz, top)


def rear_legs_as_posts(rng: Rng, space: backs.BackSpace, top: float) -> list[Solid]:
    """Rear legs that run on into the back's uprights."""
    radius = rng.between(0.012, 0.022)
    kick = rng.between(0.0, 0.12)
    return [
        Tube(
            path=np.stack(
                [vector(k * space.hx, radius, space.z - kick), space.at(k * space.hx, 0), space.at(k * space.hx, 0.9)]
            ),
            radius=radius,
        )
        for k in (-1, 1)
    ]


def shell_chair(rng: Rng, top: float, *, arms: bool = False) -> tuple[list[Solid], Array]:
    """One bent plate as seat and back: plywood, plastic shells, buckets; `arms` bends the sides up far."""
    hx, hz = rng.between(0.20, 0.27), rng.between(0.2, 0.25)
    rise, lean = rng.between(0.28, 0.55), rng.between(0.08, 0.4)
    thickness = rng.between(0.012, 0.05)
    drop = rng.between(0.0, 0.05)
    control = np.array(
        [
            (-hz - lean * rise, top + rise),
            (-hz - lean * rise * 0.45 + 0.01, top + rise * 0.5),
            (-hz + 0.01, top + 0.09),
            (-hz + 0.09, top - 0.015),
            (0.0, top - thickness / 2),
            (hz * 0.7, top + 0.01),
            (hz, top - drop),
        ]
    )
    profile = smooth_curve(control, count=20)
    t = np.linspace(0, 1, 20)
    crown = rng.pick([0.0, 0.3, 0.55])
    waist = rng.between(0.0, 0.3) if rng.chance(0.4) else 0.0
    width = hx * (1 - crown * (1 - np.minimum(1, t * 5)) ** 2) * (1 - waist * np.exp(-(((t - 0.45) / 0.1) ** 2)))
    depth = rng.between(0.08, 0.14) if arms else rng.between(0.0, 0.07)
    bend = depth * np.interp(t, [0, 0.2, 0.45, 0.8, 1], [0.4, 0.9, 1.0, 0.7, 0.1])
    power = 3.0 if arms else 2.0
    shell = Sheet(profile=profile, thickness=thickness, half_width=width, bend=bend, bend_power=power)
    return [shell, *stand(rng, hx * 0.85, hz * 0.85, top - thickness)], vector(0, top, 0)[None]
