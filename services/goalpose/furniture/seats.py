"""Seat plates, cushions and armrests shared by several kinds of furniture."""

from __future__ import annotations

import numpy as np

from goalpose.furniture.dice import Dice
from goalpose.furniture.sheets import Prism, Sheet
from goalpose.furniture.solids import Box, Loft, Pillow, Solid, Tube, turn_x, vector


def seat_plate(dice: Dice, hx: float, hz: float, top: float, thickness: float, *, round_share: float = 0.15) -> list[Solid]:
    """A seat whose highest middle is at `top` [m]: board, rounded board, disc, trapezoid, slats, dished, padded."""
    tilt = -dice.between(0.0, 0.12) if dice.chance(0.4) else 0.0
    middle = vector(0, top - thickness / 2, 0)
    style = dice.pick(["box", "rounded", "plan", "plan", "slats", "dished", "padded", "padded"])
    if dice.chance(round_share):
        style = "disc"
    if style in {"box", "rounded"}:
        radius = 0.0 if style == "box" else thickness * 0.49
        return [Box(center=middle, half=vector(hx, thickness / 2, hz), radius=radius, rotation=turn_x(tilt))]
    if style in {"plan", "disc"}:
        power = 2.0 if style == "disc" else dice.between(3.0, 9.0)
        half = np.array([[hx * 0.95, hz * 0.95], [hx, hz], [hx, hz], [hx * 0.94, hz * 0.94]])
        heights = np.array([-0.5, -0.3, 0.3, 0.5]) * thickness
        return [Loft(center=middle, heights=heights, half=half, power=power, rotation=turn_x(tilt))]
    if style == "slats":
        return _slatted(dice, hx, hz, top, min(thickness, 0.03), tilt)
    if style == "dished":
        return [dished(dice, hx, hz, top, min(thickness, 0.035), tilt)]
    base = Box(center=vector(0, top - thickness * 0.75, 0), half=vector(hx, thickness / 4, hz), rotation=turn_x(tilt))
    pad = Pillow(center=middle, half=vector(hx, thickness / 2, hz), plan=dice.between(4, 8), profile=3.0, rotation=turn_x(tilt))
    return [base, pad]


def _slatted(dice: Dice, hx: float, hz: float, top: float, thickness: float, tilt: float) -> list[Solid]:
    count, fill = dice.count(3, 9), dice.between(0.6, 0.92)
    across, turn = dice.chance(0.6), turn_x(tilt)
    length = hz if across else hx
    solids: list[Solid] = []
    for middle in (np.arange(count) + 0.5) / count * 2 * length - length:
        half = length / count * fill
        size = vector(hx, thickness / 2, half) if across else vector(half, thickness / 2, hz)
        place = vector(0, 0, middle) if across else vector(middle, 0, 0)
        solids.append(Box(center=turn @ place + vector(0, top - thickness / 2, 0), half=size, rotation=turn))
    ends = [vector(k * hx * 0.9, 0, 0) if across else vector(0, 0, k * hz * 0.9) for k in (-1, 1)]
    size = vector(0.015, 0.015, hz) if across else vector(hx, 0.015, 0.015)
    return solids + [Box(center=turn @ e + vector(0, top - thickness - 0.01, 0), half=size, rotation=turn) for e in ends]


def dished(dice: Dice, hx: float, hz: float, top: float, thickness: float, tilt: float) -> Sheet:
    """A bent plate whose sides rise, with a waterfall front edge."""
    z = np.linspace(-hz, hz, 8)
    y = top - thickness / 2 + tilt * -z - dice.between(0.0, 0.05) * np.clip(z / hz, 0, 1) ** 3
    width = hx * np.array([0.85, 0.95, 1, 1, 1, 1, 0.97, 0.9])
    return Sheet(profile=np.stack([z, y], -1), thickness=thickness, half_width=width, bend=np.full(8, dice.between(0, 0.04)))


def thin_arms(dice: Dice, hx: float, hz: float, seat: float, *, rise: float, back_z: float) -> list[Solid]:
    """Armrests of rails on posts: flat boards, bent tubes, or loops; open underneath."""
    y, radius = seat + rise, dice.between(0.01, 0.02)
    front = hz * dice.between(0.4, 1.0)
    x, out = hx + dice.between(0.0, 0.04), dice.between(0.0, 0.05)
    style = dice.pick(["board", "tube", "loop", "sloped", "pad"])
    solids: list[Solid] = []
    for side in (-1, 1):
        low, high = vector(side * x, seat - 0.03, front), vector(side * (x + out), y, front)
        rear = vector(side * x, y + dice.between(-0.0, 0.03), back_z)
        if style in {"board", "sloped", "pad"}:
            drop = 0.06 if style == "sloped" else 0.0
            thick = 0.025 if style == "pad" else 0.012
            middle = (high + rear) / 2 - vector(0, drop / 2, 0)
            turn = turn_x(np.arctan2(drop, front - back_z))
            width = dice.between(0.02, 0.045)
            half = vector(width, thick, (front - back_z) / 2 + 0.03)
            solids.append(Box(center=middle, half=half, rotation=turn, radius=thick * 0.6))
            solids.append(Tube(path=np.stack([low, high - vector(0, drop, 0)]), radius=radius))
            if dice.chance(0.3):
                solids.append(Tube(path=np.stack([vector(side * x, seat - 0.03, -hz * 0.8), rear]), radius=radius))
        elif style == "tube":
            bend = high + vector(0, 0, 0.04) - vector(0, 0.04, 0)
            solids.append(Tube(path=np.stack([low, bend, high, rear]), radius=radius * 1.2))
        else:
            rear_low = vector(side * x, seat - 0.03, -hz * 0.5)
            solids.append(Tube(path=np.stack([low, high, vector(side * (x + out), y, -hz * 0.5), rear_low]), radius=radius))
    return solids


def thick_arms(dice: Dice, hx: float, z: tuple[float, float], base: float, top: float, *, thickness: float) -> list[Solid]:
    """Upholstered arms outside `±hx` from `z[0]` (rear) to `z[1]` (front): boxes, rolls, slopes, flared, padded tops."""
    style = dice.pick(["box", "rounded", "roll", "slope", "padded", "flare", "open"])
    middle_z, half_z = (z[0] + z[1]) / 2, (z[1] - z[0]) / 2
    lean = dice.between(0.03, 0.12) if style == "flare" else 0.0
    solids: list[Solid] = []
    for side in (-1, 1):
        x, middle = side * (hx + thickness / 2), vector(side * (hx + thickness / 2), (base + top) / 2, middle_z)
        half = vector(thickness / 2, (top - base) / 2, half_z)
        if style in {"box", "rounded"}:
            radius = 0.0 if style == "box" else thickness * dice.between(0.15, 0.49)
            solids.append(Box(center=middle, half=half, radius=radius))
        elif style == "roll":
            radius = thickness * dice.between(0.55, 0.75)
            path = np.array([(x, top - radius, z[0] + radius * 0.5), (x, top - radius, z[1] - radius * 0.5)])
            solids += [Tube(path=path, radius=radius), Box(center=middle - vector(0, radius / 2, 0), half=half * vector(0.8, 1, 1) - vector(0, radius / 2, 0))]
        elif style == "slope":
            front = base + (top - base) * _fixed_fraction(thickness)
            outline = np.array([(z[0], base), (z[1], base), (z[1], front), (z[1] - half_z * 0.5, front + (top - front) * 0.25), (z[0], top)])
            solids.append(Prism(center=vector(x, 0, 0), outline=outline, half_width=thickness / 2))
        elif style == "padded":
            solids.append(Box(center=middle, half=half, radius=thickness * 0.2))
            pad = vector(thickness * 0.55, 0.05, half_z * 0.95)
            solids.append(Pillow(center=vector(x, top, middle_z), half=pad, plan=6.0))
        elif style == "flare":
            shift = np.array([[0.0, 0.0], [side * lean, 0.0]])
            section = np.repeat(half[None, ::2], 2, axis=0)
            solids.append(Loft(center=vector(x, base, middle_z), heights=np.array([0, top - base]), half=section, shift=shift))
        else:
            rail = vector(thickness / 2, min(0.04, half[1]), half_z)
            solids.append(Box(center=vector(x, top - rail[1], middle_z), half=rail, radius=0.01))
            for end in (z[0] + 0.03, z[1] - 0.03):
                solids.append(Box(center=vector(x, (base + top) / 2, end), half=vector(thickness * 0.4, half[1], 0.03)))
    return solids


def _fixed_fraction(thickness: float) -> float:
    """Height of a sloping arm's front as a share, the same on both sides."""
    return 0.45 + (thickness * 37.0) % 0.35
