"""Loungers: deck chairs, pool loungers, relax chairs; one half sits, half lies."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from roam_goalpose.furniture import legs
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.sheets import Sheet, smooth_curve
from roam_goalpose.furniture.solids import Array, Pillow, Solid, Tube, vector


def build(rng: Rng) -> Furniture:
    """A lounger: a bent sling or mat on a frame."""
    profile, seat = _long_profile(rng) if rng.chance(0.65) else _deck_profile(rng)
    hx, thick = rng.between(0.26, 0.36), rng.pick([rng.between(0.012, 0.03), rng.between(0.04, 0.12)])
    solids: list[Solid] = _mat(rng, profile, hx, thick)
    solids += _stand(rng, profile, hx)
    if rng.chance(0.25):
        head = profile[1]
        solids.append(Pillow(center=vector(0, head[1] + 0.04, head[0] + 0.05), half=vector(hx * 0.8, 0.05, 0.1)))
    if rng.chance(0.3):
        y = seat[1] + rng.between(0.14, 0.22)
        for side in (-1, 1):
            path = np.array(
                [
                    (side * hx, seat[1], 0.2),
                    (side * hx, y, 0.18),
                    (side * hx, y, -0.3),
                    (side * hx, seat[1] + 0.1, -0.32),
                ]
            )
            solids.append(Tube(path=path, radius=0.014))
    lie = np.array([[0, *profile[-1][::-1]], [0, *profile[0][::-1]]])
    return Furniture("lounger", tuple(solids), seat[None], lie)


def _long_profile(rng: Rng) -> tuple[Array, Array]:
    """Legs up: back, seat, knee and foot part."""
    top, back, lean = rng.between(0.2, 0.42), rng.between(0.55, 0.8), rng.between(0.6, 1.25)
    rise, knee = back * np.cos(lean), rng.between(0.0, 0.14)
    z = -0.2 - back * np.sin(lean)
    control = np.array(
        [(z, top + rise), (-0.2, top + 0.03), (0.0, top), (0.35, top + knee), (rng.between(0.8, 1.15), top - 0.02)]
    )
    return smooth_curve(control, count=18), vector(0, top + 0.01, 0.0)


def _deck_profile(rng: Rng) -> tuple[Array, Array]:
    """A steep sling as of a deck chair."""
    top, lean, back = rng.between(0.26, 0.38), rng.between(0.4, 0.8), rng.between(0.6, 0.8)
    control = np.array(
        [
            (-0.2 - back * np.sin(lean), top + back * np.cos(lean)),
            (-0.22, top + 0.05),
            (0.0, top),
            (rng.between(0.25, 0.4), top + 0.06),
        ]
    )
    return smooth_curve(control, count=14), vector(0, top + 0.01, 0.0)


def _mat(rng: Rng, profile: Array, hx: float, thick: float) -> list[Solid]:
    """The lying surface in one, or cut into slats."""
    if rng.chance(0.7):
        sag = -rng.between(0.0, 0.05) if rng.chance(0.4) else rng.between(0.0, 0.03)
        width = np.full(len(profile), hx)
        return [Sheet(profile=profile, thickness=thick, half_width=width, bend=np.full(len(profile), abs(sag)))]
    slats: list[Solid] = []
    for a, b in pairwise(profile):
        ends = np.stack([a * 0.85 + b * 0.15, a * 0.15 + b * 0.85])
        slats.append(Sheet(profile=ends, thickness=min(thick, 0.03), half_width=np.full(2, hx)))
    rails = [np.stack([np.full(len(profile), s * hx), profile[:, 1], profile[:, 0]], -1) for s in (-1, 1)]
    return slats + [Tube(path=rail, radius=0.014) for rail in rails]


def _stand(rng: Rng, profile: Array, hx: float) -> list[Solid]:
    """Crossed side frames, or legs at both ends."""
    rear, front, radius = profile[len(profile) // 4], profile[-2], rng.between(0.012, 0.022)
    solids: list[Solid] = []
    if rng.chance(0.3):
        for side in (-1, 1):
            x = side * hx
            solids.append(Tube(path=np.array([(x, radius, front[0]), (x, rear[1], rear[0])]), radius=radius))
            solids.append(Tube(path=np.array([(x, radius, rear[0] - 0.1), (x, front[1], front[0])]), radius=radius))
        return solids
    low_back = float(np.interp(-0.2, [profile[0, 0], profile[-1, 0]], [0, 1]))
    for z, y in (rear, front, profile[int(low_back * (len(profile) - 1))]):
        for side in (-1, 1):
            head = vector(side * (hx - 0.03), float(y), float(z))
            foot = head * vector(1, 0, 1) + vector(0, 0, rng.between(-0.05, 0.05))
            solids.append(legs.post(foot, head, foot_half=radius, head_half=radius, power=rng.pick([2.0, 40.0])))
    return solids
