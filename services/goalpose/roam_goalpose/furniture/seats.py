"""Seat plates shared by several kinds of furniture."""

from __future__ import annotations

import numpy as np

from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.sheets import Sheet
from roam_goalpose.furniture.solids import Box, Loft, Pillow, Solid, turn_x, vector


def seat_plate(
    rng: Rng, hx: float, hz: float, top: float, thickness: float, *, round_share: float = 0.15
) -> list[Solid]:
    """A seat whose highest middle is at `top` [m]: board, rounded board, disc, trapezoid, slats, dished, padded."""
    tilt = -rng.between(0.0, 0.12) if rng.chance(0.4) else 0.0
    middle = vector(0, top - thickness / 2, 0)
    style = rng.pick(["box", "rounded", "plan", "plan", "slats", "dished", "padded", "padded"])
    if rng.chance(round_share):
        style = "disc"
    if style in {"box", "rounded"}:
        radius = 0.0 if style == "box" else thickness * 0.49
        return [Box(center=middle, half=vector(hx, thickness / 2, hz), radius=radius, rotation=turn_x(tilt))]
    if style in {"plan", "disc"}:
        power = 2.0 if style == "disc" else rng.between(3.0, 9.0)
        half = np.array([[hx * 0.95, hz * 0.95], [hx, hz], [hx, hz], [hx * 0.94, hz * 0.94]])
        heights = np.array([-0.5, -0.3, 0.3, 0.5]) * thickness
        return [Loft(center=middle, heights=heights, half=half, power=power, rotation=turn_x(tilt))]
    if style == "slats":
        return _slatted(rng, hx, hz, top, min(thickness, 0.03), tilt)
    if style == "dished":
        return [dished(rng, hx, hz, top, min(thickness, 0.035), tilt)]
    base = Box(center=vector(0, top - thickness * 0.75, 0), half=vector(hx, thickness / 4, hz), rotation=turn_x(tilt))
    pad = Pillow(
        center=middle, half=vector(hx, thickness / 2, hz), plan=rng.between(4, 8), profile=3.0, rotation=turn_x(tilt)
    )
    return [base, pad]


def _slatted(rng: Rng, hx: float, hz: float, top: float, thickness: float, tilt: float) -> list[Solid]:
    count, fill = rng.count(3, 9), rng.between(0.6, 0.92)
    across, turn = rng.chance(0.6) or hx > 1.5 * hz, turn_x(tilt)  # on benches, boards run along the bench
    length = hz if across else hx
    solids: list[Solid] = []
    for middle in (np.arange(count) + 0.5) / count * 2 * length - length:
        half = length / count * fill
        size = vector(hx, thickness / 2, half) if across else vector(half, thickness / 2, hz)
        place = vector(0, 0, middle) if across else vector(middle, 0, 0)
        solids.append(Box(center=turn @ place + vector(0, top - thickness / 2, 0), half=size, rotation=turn))
    ends = [vector(k * hx * 0.9, 0, 0) if across else vector(0, 0, k * hz * 0.9) for k in (-1, 1)]
    size = vector(0.015, 0.015, hz) if across else vector(hx, 0.015, 0.015)
    return solids + [
        Box(center=turn @ e + vector(0, top - thickness - 0.01, 0), half=size, rotation=turn) for e in ends
    ]


def dished(rng: Rng, hx: float, hz: float, top: float, thickness: float, tilt: float) -> Sheet:
    """A bent plate whose sides rise, with a waterfall front edge."""
    z = np.linspace(-hz, hz, 8)
    y = top - thickness / 2 + tilt * -z - rng.between(0.0, 0.05) * np.clip(z / hz, 0, 1) ** 3
    width = hx * np.array([0.85, 0.95, 1, 1, 1, 1, 0.97, 0.9])
    return Sheet(
        profile=np.stack([z, y], -1), thickness=thickness, half_width=width, bend=np.full(8, rng.between(0, 0.04))
    )
