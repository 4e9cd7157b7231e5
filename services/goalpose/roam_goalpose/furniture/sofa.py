"""Sofas: one to four seats, arms or none, loose cushions, L-shapes and chaises, sloped backs, daybeds."""

from __future__ import annotations

import numpy as np

from roam_goalpose.furniture import arms, backs, legs
from roam_goalpose.furniture.bench import places
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.sheets import Prism, Wall
from roam_goalpose.furniture.solids import Array, Box, Pillow, Solid, turn_x, vector


def build(rng: Rng) -> Furniture:
    """A sofa of one of four layouts."""
    count = rng.pick([1, 2, 2, 3, 3, 3, 4])
    hx = count * rng.between(0.24, 0.36) + (0.1 if count == 1 else 0.0)
    hz, top = rng.between(0.26, 0.42), rng.between(0.32, 0.50)
    kind = rng.pick(["block"] * 6 + ["corner", "chaise", "profile", "rounded"])
    if kind == "profile":
        solids = _profile_sofa(rng, hx, hz, top)
    elif kind == "rounded":
        solids = _rounded_sofa(rng, hx, hz, top)
    else:
        solids = _block_sofa(rng, hx, hz, top, count)
    if kind == "corner" or kind == "chaise":
        solids += _extension(rng, hx, hz, top, with_back=kind == "corner")
    lie = lie_line(hx, top) if hx > 0.75 else None
    return Furniture("sofa", tuple(solids), places(hx, top, z=0.02), lie)


def lie_line(hx: float, top: float) -> Array:
    """Feet and head `[2, 3]` of somebody lying along x, head at +x."""
    reach = min(hx - 0.05, 0.88)
    return np.array([[-reach, top, 0.0], [reach, top, 0.0]])


def _base(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    if rng.chance(0.75):
        return legs.plinth(rng, hx, hz, top)
    frame = Box(center=vector(0, top - 0.05, 0), half=vector(hx, 0.05, hz))
    return [frame, *legs.four_legs(rng, hx, hz, top - 0.05, rungs=0.05)]


def _block_sofa(rng: Rng, hx: float, hz: float, top: float, count: int) -> list[Solid]:
    """Base, seat cushions, back with or without cushions, two arms, one or none."""
    cushion = rng.between(0.08, 0.2)
    thick, arm = rng.between(0.08, 0.24), rng.between(0.06, 0.26)
    high = top + rng.between(0.24, 0.56)
    solids = _base(rng, hx, hz, top - cushion * 0.85)
    solids += cushions(rng, hx, hz, top, cushion, count if rng.chance(0.75) else 1)
    has_arms = rng.chance(0.85)
    outer = hx + (arm if has_arms and rng.chance(0.6) else 0.0)
    space = backs.BackSpace(outer, -hz - thick * 0.3, rng.pick([0.05, top - 0.15]), high, rng.between(0.0, 0.3), thick)
    solids.append(backs.panel(rng, space))
    if rng.chance(0.6):
        solids += _back_cushions(rng, space, hx, top, count)
    if has_arms:
        low = rng.pick([0.0, 0.04, 0.1, top - 0.2])
        made = arms.thick_arms(
            rng,
            hx,
            (-hz - thick * 0.6, hz + rng.between(-0.05, 0.05)),
            max(low, 0.0),
            top + rng.between(0.05, 0.28),
            thickness=arm,
        )
        one = rng.chance(0.08)
        solids += made[: len(made) // 2] if one else made
    if rng.chance(0.3):
        solids += [_throw(rng, space, side * hx * rng.between(0.4, 0.85), top) for side in (-1, 1)]
    return solids


def cushions(rng: Rng, hx: float, hz: float, top: float, height: float, count: int) -> list[Solid]:
    """`count` seat cushions side by side whose tops are at `top`."""
    soft, half = rng.chance(0.4), hx / count
    plan, profile, radius = rng.between(5, 10), rng.between(2.5, 5), rng.between(0.02, 0.45) * height
    solids: list[Solid] = []
    for k in range(count):
        middle = vector(-hx + half * (2 * k + 1), top - height / 2, 0)
        size = vector(half * 0.985, height / 2, hz)
        solids.append(
            Pillow(center=middle, half=size, plan=plan, profile=profile)
            if soft
            else Box(center=middle, half=size, radius=radius)
        )
    return solids


def _back_cushions(rng: Rng, space: backs.BackSpace, hx: float, top: float, count: int) -> list[Solid]:
    depth, half = rng.between(0.05, 0.11), hx / count
    height = (space.high - top) * rng.between(0.75, 1.25) / 2
    lean = space.lean + rng.between(0.0, 0.2)
    turn = turn_x(-np.arctan(lean) + np.pi / 2)
    plan = rng.between(3, 8)
    z = space.z - space.lean * (top + height - space.low) + space.thickness / 2 + depth * 0.8
    return [
        Pillow(
            center=vector(-hx + half * (2 * k + 1), top + height, z),
            half=vector(half * 0.97, depth, height),
            rotation=turn,
            plan=plan,
        )
        for k in range(count)
    ]


def _throw(rng: Rng, space: backs.BackSpace, x: float, top: float) -> Solid:
    size = rng.between(0.17, 0.25)
    turn = turn_x(np.pi / 2 - rng.between(0.2, 0.6))
    return Pillow(
        center=vector(x, top + size * 0.85, space.z + 0.2), half=vector(size, 0.06, size), rotation=turn, plan=3.5
    )


def _extension(rng: Rng, hx: float, hz: float, top: float, *, with_back: bool) -> list[Solid]:
    """The short leg of an L, on a random side, in front of the last seat."""
    side, width, reach = rng.pick([-1, 1]), rng.between(0.3, 0.4), rng.between(0.25, 0.75)
    width = min(width, hx)
    gap, pad = rng.between(0.0, 0.12), rng.between(0.08, 0.2)
    x, z = side * (hx - width), hz + reach
    solids: list[Solid] = [
        Box(center=vector(x, (gap + top - pad) / 2, z), half=vector(width, (top - pad - gap) / 2, reach)),
        Box(
            center=vector(x, top - pad / 2, z),
            half=vector(width, pad / 2, reach),
            radius=pad * rng.between(0.05, 0.45),
        ),
    ]
    if gap:
        solids.append(
            Box(
                center=vector(x + side * width * 0.8, gap / 2, z + reach * 0.85),
                half=vector(0.025, gap / 2 + 0.01, 0.025),
            )
        )
    if with_back:
        high = rng.between(0.2, 0.45)
        solids.append(
            Box(
                center=vector(side * (hx + 0.08), (top + high) / 2, z),
                half=vector(0.09, (top + high) / 2, reach),
                radius=0.03,
            )
        )
    return solids


def _profile_sofa(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """One sloped profile swept sideways: fold-out sofas, waiting-room seats."""
    lean, rise = rng.between(0.1, 0.5), rng.between(0.3, 0.5)
    low, thick = rng.between(0.0, 0.2), rng.between(0.1, 0.25)
    back_z = -hz - lean * rise
    outline = np.array(
        [
            (hz, low), (hz + 0.02, top - 0.05), (hz - 0.03, top), (-hz, top - 0.02), (back_z, top + rise),
            (back_z - thick * 0.6, top + rise - 0.02), (back_z - thick, top + rise * 0.7), (-hz - thick, low),
        ]
    )  # fmt: skip
    solids: list[Solid] = [Prism(outline=outline, half_width=hx)]
    if low > 0.03:
        middle = float(outline[:, 0].mean())
        feet = legs.corners(hx - 0.08, hz * 0.7)
        solids += [
            legs.post(f + vector(0, 0, middle), h + vector(0, low + 0.02, middle), foot_half=0.02, head_half=0.03)
            for f, h in feet
        ]
    if rng.chance(0.4):
        solids += arms.thick_arms(
            rng, hx, (-hz, hz), low, top + rng.between(0.08, 0.2), thickness=rng.between(0.06, 0.2)
        )
    return solids


def _rounded_sofa(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """A tub sofa: a round wall around one long cushion."""
    thick, rise, pad = rng.between(0.06, 0.2), rng.between(0.22, 0.42), rng.between(0.08, 0.18)
    wall = Wall(
        radius=vector(hx + thick / 2, hz + thick / 2), thickness=thick, sweep=rng.between(1.5, 1.9),
        bottom=rng.pick([0.05, 0.12]), top=vector(top + rise, top + rise * rng.between(0.4, 0.9)),
        lean=rng.between(0, 0.15), fall=rng.between(0.8, 3.0),
    )  # fmt: skip
    return [
        wall,
        *cushions(rng, hx * 0.92, hz * 0.9, top, pad, rng.pick([1, 2])),
        *_base(rng, hx * 0.95, hz * 0.85, top - pad * 0.8),
    ]
