"""Armrests: thin ones of rails on posts, thick ones of upholstery. A new one is a function and a word in its list."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.sheets import Prism
from roam_goalpose.furniture.solids import Array, Box, Loft, Pillow, Solid, Tube, turn_x, vector


@dataclass(frozen=True)
class Rail:
    """Where a thin armrest runs on one side."""

    side: int
    low: Array
    """`[3]` foot of the front post, at the seat's edge."""
    high: Array
    """`[3]` front end of the rest."""
    rear: Array
    """`[3]` where the rest meets the back."""
    radius: float
    hz: float


def thin_arms(rng: Rng, hx: float, hz: float, seat: float, *, rise: float, back_z: float) -> list[Solid]:
    """Armrests `rise` [m] over the seat, open underneath, the same on both sides."""
    style = rng.pick([_board, _board, _board, _tube, _loop])
    drop, thick = rng.pick([(0.0, 0.012), (0.06, 0.012), (0.0, 0.025)])
    radius, front = rng.between(0.01, 0.02), hz * rng.between(0.4, 1.0)
    x, out = hx + rng.between(0.0, 0.04), rng.between(0.0, 0.05)
    width, climb, rear_post = rng.between(0.02, 0.045), rng.between(0.0, 0.03), rng.chance(0.3)
    solids: list[Solid] = []
    for side in (-1, 1):
        low, high = vector(side * x, seat - 0.03, front), vector(side * (x + out), seat + rise, front)
        rail = Rail(side, low, high, vector(side * x, seat + rise + climb, back_z), radius, hz)
        solids += style(rail, vector(width, thick, drop))
        if rear_post:
            solids.append(Tube(path=np.stack([vector(side * x, seat - 0.03, -hz * 0.8), rail.rear]), radius=radius))
    return solids


def _board(rail: Rail, size: Array) -> list[Solid]:
    """A flat or sloping board on a post; `size` is half width, half thickness, drop of the front end."""
    width, thick, drop = size
    length = float(rail.high[2] - rail.rear[2])
    middle = (rail.high + rail.rear) / 2 - vector(0, drop / 2, 0)
    half, turn = vector(width, thick, length / 2 + 0.03), turn_x(float(np.arctan2(drop, length)))
    rest = Box(center=middle, half=half, rotation=turn, radius=thick * 0.6)
    return [rest, Tube(path=np.stack([rail.low, rail.high - vector(0, drop, 0)]), radius=rail.radius)]


def _tube(rail: Rail, size: Array) -> list[Solid]:
    """One bent tube from seat to back."""
    bend = rail.high + vector(0, -0.04, 0.04)
    return [Tube(path=np.stack([rail.low, bend, rail.high, rail.rear]), radius=rail.radius * 1.2)]


def _loop(rail: Rail, size: Array) -> list[Solid]:
    """A loop that starts and ends under the seat."""
    back = vector(rail.high[0], rail.high[1], -rail.hz * 0.5)
    end = vector(rail.low[0], rail.low[1], -rail.hz * 0.5)
    return [Tube(path=np.stack([rail.low, rail.high, back, end]), radius=rail.radius)]


@dataclass(frozen=True)
class ArmBlock:
    """The space of a thick arm on one side."""

    side: int
    x: float
    base: float
    top: float
    rear: float
    front: float
    thickness: float

    @property
    def middle(self) -> Array:
        return vector(self.x, (self.base + self.top) / 2, (self.rear + self.front) / 2)

    @property
    def half(self) -> Array:
        return vector(self.thickness / 2, (self.top - self.base) / 2, (self.front - self.rear) / 2)


def thick_arms(
    rng: Rng, hx: float, z: tuple[float, float], base: float, top: float, *, thickness: float
) -> list[Solid]:
    """Upholstered arms outside `±hx` from `z[0]` (rear) to `z[1]` (front), the same on both sides."""
    style = rng.pick([_box, _rounded, _roll, _slope, _padded, _flare, _frame])
    amount = rng.between(0.0, 1.0)
    solids: list[Solid] = []
    for side in (-1, 1):
        solids += style(ArmBlock(side, side * (hx + thickness / 2), base, top, z[0], z[1], thickness), amount)
    return solids


def _box(arm: ArmBlock, amount: float) -> list[Solid]:
    return [Box(center=arm.middle, half=arm.half)]


def _rounded(arm: ArmBlock, amount: float) -> list[Solid]:
    return [Box(center=arm.middle, half=arm.half, radius=arm.thickness * (0.15 + 0.34 * amount))]


def _roll(arm: ArmBlock, amount: float) -> list[Solid]:
    """A scroll arm."""
    radius = arm.thickness * (0.55 + 0.2 * amount)
    y, inset = arm.top - radius, radius * 0.5
    roll = Tube(path=np.array([(arm.x, y, arm.rear + inset), (arm.x, y, arm.front - inset)]), radius=radius)
    lower = vector(0, radius / 2, 0)
    return [roll, Box(center=arm.middle - lower, half=arm.half * vector(0.8, 1, 1) - lower)]


def _slope(arm: ArmBlock, amount: float) -> list[Solid]:
    """High at the back, falling towards the front."""
    front = arm.base + (arm.top - arm.base) * (0.45 + 0.35 * amount)
    bend = (arm.front - arm.half[2] * 0.5, front + (arm.top - front) * 0.25)
    outline = np.array([(arm.rear, arm.base), (arm.front, arm.base), (arm.front, front), bend, (arm.rear, arm.top)])
    return [Prism(center=vector(arm.x, 0, 0), outline=outline, half_width=arm.thickness / 2)]


def _padded(arm: ArmBlock, amount: float) -> list[Solid]:
    pad = vector(arm.thickness * 0.55, 0.03 + 0.03 * amount, arm.half[2] * 0.95)
    top = vector(arm.x, arm.top, arm.middle[2])
    return [Box(center=arm.middle, half=arm.half, radius=arm.thickness * 0.2), Pillow(center=top, half=pad, plan=6.0)]


def _flare(arm: ArmBlock, amount: float) -> list[Solid]:
    """Leaning outwards."""
    shift = np.array([[0.0, 0.0], [arm.side * (0.03 + 0.09 * amount), 0.0]])
    section = np.repeat(arm.half[None, ::2], 2, axis=0)
    heights = np.array([0.0, arm.top - arm.base])
    return [Loft(center=vector(arm.x, arm.base, arm.middle[2]), heights=heights, half=section, shift=shift)]


def _frame(arm: ArmBlock, amount: float) -> list[Solid]:
    """A rail on two posts, open in between."""
    rail = vector(arm.half[0], min(0.04, arm.half[1]), arm.half[2])
    solids: list[Solid] = [Box(center=vector(arm.x, arm.top - rail[1], arm.middle[2]), half=rail, radius=0.01)]
    for end in (arm.rear + 0.03, arm.front - 0.03):
        post = vector(arm.thickness * 0.4, arm.half[1], 0.03)
        solids.append(Box(center=vector(arm.x, arm.middle[1], end), half=post))
    return solids
