"""What furniture stands on: four legs of many shapes, sleds and cantilevers, pedestals, star feet, rockers, plinths.

Each function returns solids that reach from the floor to `top` [m] under a seat of half width `hx` and half depth `hz`.
"""

from __future__ import annotations

import numpy as np

from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.solids import Array, Box, Loft, Solid, Tube, turn_y, vector


def post(
    foot: Array, head: Array, *, foot_half: float, head_half: float, power: float = 40.0, bow: float = 0.0
) -> Loft:
    """A tapered, tilted post from `foot` to `head` `[3]`, cut flat at both ends; `bow` bends it outwards [m]."""
    steps = np.linspace(0, 1, 7 if bow else 2)
    half = np.repeat((foot_half + (head_half - foot_half) * steps)[:, None], 2, axis=1)
    shift = (head - foot)[::2] * steps[:, None]
    outwards = foot[::2] / max(float(np.linalg.norm(foot[::2])), 1e-6)
    shift = shift + bow * np.sin(np.pi * steps)[:, None] * outwards
    heights = steps * float(head[1] - foot[1])
    return Loft(center=foot.copy(), heights=heights, half=half, shift=shift, power=power)


def turned(foot: Array, head: Array, rng: Rng, *, half: float) -> Loft:
    """A lathe-turned post with beads."""
    steps = np.linspace(0, 1, 9)
    size = half * np.array([0.6, 0.8, 0.55, 1.0, 0.7, 0.95, 0.6, 1.0, 1.0]) * np.array([rng.between(0.8, 1.2)] * 9)
    shift = (head - foot)[::2] * steps[:, None]
    return Loft(
        center=foot.copy(),
        heights=steps * float(head[1] - foot[1]),
        half=np.stack([size, size], -1),
        shift=shift,
        power=2.0,
    )


def corners(hx: float, hz: float, *, splay_x: float = 0.0, splay_z: float = 0.0) -> list[tuple[Array, Array]]:
    """(foot, head) in x and z of the four legs, front left first; splay moves the feet outwards."""
    signs = [(1, 1), (-1, 1), (1, -1), (-1, -1)]
    return [(vector(x * (hx + splay_x), 0, z * (hz + splay_z)), vector(x * hx, 0, z * hz)) for x, z in signs]


def four_legs(rng: Rng, hx: float, hz: float, top: float, *, rungs: float = 0.4) -> list[Solid]:
    """Four legs: straight, tapered, splayed, bowed or turned; square or round; with rungs at times."""
    thick = rng.between(0.012, 0.032)
    taper = rng.pick([1.0, 1.0, 0.6, 0.75])
    power = rng.pick([40.0, 40.0, 2.0, 2.0, 5.0])
    splay = rng.between(0.02, 0.13) if rng.chance(0.45) else 0.0
    bow = rng.between(-0.03, 0.04) if rng.chance(0.2) else 0.0
    is_turned = rng.chance(0.12)
    lean = splay * rng.pick([0.0, 0.5, 1.0])
    inset = thick + rng.between(0.0, 0.04)
    solids: list[Solid] = []
    pairs = corners(max(hx - inset, 0.03), max(hz - inset, 0.03), splay_x=lean, splay_z=splay)
    for foot, head in pairs:
        head = head + vector(0, top, 0)
        solids.append(
            turned(foot, head, rng, half=thick * 1.2)
            if is_turned
            else post(foot, head, foot_half=thick * taper, head_half=thick, power=power, bow=bow)
        )
    if rng.chance(rungs):
        solids += _rungs(rng, pairs, top, thick * 0.6)
    if rng.chance(0.35):
        solids += apron(pairs, top, depth=rng.between(0.03, 0.08), half=thick * 0.7)
    return solids


def _rungs(rng: Rng, pairs: list[tuple[Array, Array]], top: float, radius: float) -> list[Solid]:
    """Stretchers between the legs: an H, a box, or sides only."""
    level = rng.between(0.2, 0.6)
    at = [foot * (1 - level) + head * level + vector(0, top * level, 0) for foot, head in pairs]
    sides = [(at[0], at[2]), (at[1], at[3])]
    style = rng.pick(["sides", "box", "h", "cross"])
    if style == "box":
        step = vector(0, rng.between(-0.05, 0.05), 0)
        sides += [(at[0] + step, at[1] + step), (at[2] + step, at[3] + step)]
    elif style == "h":
        sides.append(((at[0] + at[2]) / 2, (at[1] + at[3]) / 2))
    elif style == "cross":
        sides = [(at[0], at[3]), (at[1], at[2])]
    return [Tube(path=np.stack(ends), radius=radius) for ends in sides]


def apron(pairs: list[tuple[Array, Array]], top: float, *, depth: float, half: float) -> list[Solid]:
    """Boards under the seat, from leg to leg."""
    (x, _, z), y = pairs[0][1], top - depth / 2
    front = [Box(center=vector(0, y, s * z), half=vector(x, depth / 2, half)) for s in (-1, 1)]
    sides = [Box(center=vector(s * x, y, 0), half=vector(half, depth / 2, z)) for s in (-1, 1)]
    return [*front, *sides]


def sled(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """Two tube loops at the sides: skids, inverted U, or a cantilever without back legs."""
    radius, x = rng.between(0.008, 0.018), hx - rng.between(0.0, 0.04)
    front, back, low = hz + rng.between(-0.03, 0.05), -hz - rng.between(-0.03, 0.06), radius
    style = rng.pick(["skid", "loop", "cantilever", "hairpin"])
    if style == "skid":
        path = [(hz * 0.8, top), (front, low), (back, low), (-hz * 0.8, top)]
    elif style == "loop":
        path = [(front, top), (front, low), (back, low), (back, top), (front, top)]
    elif style == "cantilever":
        path = [
            (-hz, top),
            (front - 0.03, top),
            (front, top - 0.04),
            (front, low + 0.04),
            (front - 0.03, low),
            (back, low),
        ]
    else:
        path = [(front, low), (hz * 0.5, top), (0.0, top), (-hz * 0.5, top), (back, low)]
    solids: list[Solid] = [Tube(path=np.array([(side * x, y, z) for z, y in path]), radius=radius) for side in (-1, 1)]
    if style in {"skid", "cantilever"}:
        solids.append(Tube(path=np.array([(-x, low, back), (x, low, back)]), radius=radius))
    if style == "hairpin":
        solids += [Tube(path=np.array([(-x, low, z), (x, low, z)]), radius=radius) for z in (front, back)]
    return solids


def pedestal(rng: Rng, top: float, *, radius: float) -> list[Solid]:
    """One column on a flared round foot."""
    column, flare = rng.between(0.018, 0.05), rng.between(0.015, 0.12)
    heights = np.array([0, 0.012, 0.02 + flare * 0.5, 0.02 + flare, top])
    half = np.array([radius, radius, column * 2.0, column, column * rng.between(0.9, 1.6)])
    return [Loft(heights=heights, half=np.stack([half, half], -1), power=2.0)]


def star_foot(rng: Rng, top: float, *, reach: float) -> list[Solid]:
    """Four or five arms, with castors at times, under a gas-spring column."""
    arms, castors = rng.pick([4, 5, 5, 5]), rng.chance(0.6)
    wheel = rng.between(0.02, 0.032) if castors else 0.0
    low, hub = 2 * wheel + 0.015, rng.between(0.06, 0.14) + 2 * wheel
    column = rng.between(0.02, 0.035)
    solids: list[Solid] = [
        Loft(
            heights=np.array([low, hub, hub + 0.01, top]),
            half=np.array([[column * 1.5] * 2, [column * 1.3] * 2, [column] * 2, [column * 0.8] * 2]),
            power=2.0,
        )
    ]
    start = rng.between(0, 2 * np.pi)
    for k in range(arms):
        angle = start + 2 * np.pi * k / arms
        out = vector(np.sin(angle), 0, np.cos(angle))
        arm = np.stack([vector(0, hub - 0.02, 0), out * reach + vector(0, low, 0)])
        solids.append(Tube(path=arm, radius=rng.between(0.012, 0.02)))
        if castors:
            solids.append(
                Box(
                    center=out * reach + vector(0, wheel, 0),
                    half=vector(0.016, wheel, wheel),
                    radius=wheel * 0.7,
                    rotation=turn_y(angle + rng.between(-1, 1)),
                )
            )
    return solids


def rockers(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """Legs on two bent runners."""
    reach, rise, half = hz + rng.between(0.12, 0.25), rng.between(0.04, 0.1), rng.between(0.012, 0.02)
    z = np.linspace(-reach, reach, 9)
    y = half + rise * (z / reach) ** 2
    solids: list[Solid] = []
    for side in (-1, 1):
        x = side * (hx - 0.03)
        solids.append(Tube(path=np.stack([np.full(9, x), y, z], -1), radius=half))
        for end in (-1, 1):
            foot = vector(x, half, end * (hz - 0.03))
            solids.append(Tube(path=np.stack([foot, vector(x, top, end * (hz - 0.05))]), radius=half))
    return solids


def plinth(rng: Rng, hx: float, hz: float, top: float) -> list[Solid]:
    """A closed base down to the floor, or a low frame on short feet."""
    if rng.chance(0.5):
        inset = rng.between(0.0, 0.04)
        return [Box(center=vector(0, top / 2, 0), half=vector(hx - inset, top / 2, hz - inset))]
    gap = min(rng.between(0.03, 0.16), top * 0.6)
    thick = rng.between(0.015, 0.04)
    solids: list[Solid] = [Box(center=vector(0, (gap + top) / 2, 0), half=vector(hx, (top - gap) / 2, hz))]
    splay = rng.between(0, 0.05) if rng.chance(0.4) else 0.0
    power = rng.pick([2.0, 40.0])
    for foot, head in corners(hx - thick - 0.03, hz - thick - 0.03, splay_x=splay, splay_z=splay):
        solids.append(post(foot, head + vector(0, gap + 0.01, 0), foot_half=thick * 0.8, head_half=thick, power=power))
    return solids
