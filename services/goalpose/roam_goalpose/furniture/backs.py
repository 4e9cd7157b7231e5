"""Backrests. Each returns solids that stand on the rear edge of a seat and reach from `low` to `high` [m].

`z` is the rear edge, `lean` tips the back rearwards [m per m], `hx` is the back's half width.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from roam_goalpose.furniture.rng import Rng
from roam_goalpose.furniture.sheets import Sheet
from roam_goalpose.furniture.solids import Array, Box, Pillow, Solid, Tube, turn_x, vector


@dataclass(frozen=True)
class BackSpace:
    """Where a backrest goes."""

    hx: float
    z: float
    low: float
    high: float
    lean: float
    thickness: float

    def at(self, x: float, fraction: float, forward: float = 0.0) -> Array:
        """A point `[3]` on the tilted back plane: x, height fraction, metres towards the sitter."""
        y = self.low + (self.high - self.low) * fraction
        return vector(x, y, self.z - self.lean * (y - self.low) + forward)

    @property
    def rotation(self) -> Array:
        return turn_x(-np.arctan(self.lean))

    @property
    def length(self) -> float:
        return (self.high - self.low) * float(np.hypot(1.0, self.lean))


def panel(rng: Rng, s: BackSpace, *, start: float = 0.0, end: float = 1.0, thickness: float | None = None) -> Solid:
    """A flat or rounded board between two height fractions."""
    half = s.length * (end - start) / 2
    thick = s.thickness if thickness is None else thickness
    radius = rng.pick([0.0, 0.25, 0.49]) * 2 * min(thick, s.hx, half) * 0.98
    size = vector(s.hx, half, thick / 2)
    return Box(center=s.at(0, (start + end) / 2), half=size, rotation=s.rotation, radius=min(radius, thick * 0.49))


def curved(rng: Rng, s: BackSpace, *, start: float = 0.0, end: float = 1.0, wrap: float | None = None) -> Sheet:
    """A board bent in side view and wrapped towards the sitter, with a rounded or narrowed top."""
    fractions = np.linspace(end, start, 10)
    flare = rng.between(-0.04, 0.06)
    profile = np.array([s.at(0, f)[[2, 1]] for f in fractions])
    profile[:, 0] += flare * np.sin(np.pi * np.linspace(0, 1, 10)) * (1 if rng.chance(0.7) else -1)
    width = np.full(10, s.hx)
    style = rng.pick(["straight", "round", "narrow", "oval"])
    t = np.linspace(0, 1, 10)
    if style == "round":
        width *= np.minimum(1.0, 0.35 + np.sqrt(t * 4 + 1e-3) * 0.65)
    elif style == "narrow":
        width *= 0.7 + 0.3 * t
    elif style == "oval":
        width *= np.clip(np.sqrt(1 - (2 * t - 1) ** 2 + 1e-3), 0.3, 1.0)
    depth = rng.between(0.0, 0.09) if wrap is None else wrap
    thickness = min(s.thickness, 0.04)
    return Sheet(profile=profile, thickness=thickness, half_width=width, bend=np.full(10, depth), bend_power=2.0)


def posts(rng: Rng, s: BackSpace, *, radius: float, high: float = 1.0) -> list[Solid]:
    """The two uprights of a frame, square or round."""
    x = s.hx - radius
    if rng.chance(0.5):
        return [Tube(path=np.stack([s.at(k * x, -0.05), s.at(k * x, high)]), radius=radius) for k in (-1, 1)]
    half = vector(radius, s.length * high / 2, radius)
    return [Box(center=s.at(k * x, high / 2), half=half, rotation=s.rotation) for k in (-1, 1)]


def ladder(rng: Rng, s: BackSpace) -> list[Solid]:
    """Horizontal slats between two uprights; slats may be bent."""
    radius = rng.between(0.012, 0.024)
    count, start = rng.count(1, 6), rng.between(0.12, 0.5)
    edges = np.linspace(start, 1.0, count + 1)
    fill = rng.between(0.35, 0.8)
    wrap = -rng.between(0.01, 0.05) if rng.chance(0.4) else 0.0
    thick = rng.between(0.01, 0.025)
    solids = posts(rng, s, radius=radius, high=rng.pick([1.0, 1.0, 1.06]))
    for low, high in pairwise(edges):
        bottom = high - (high - low) * fill
        slat = BackSpace(hx=s.hx - radius, z=s.z, low=s.low, high=s.high, lean=s.lean, thickness=thick)
        if wrap:
            solids.append(_bent_slat(slat, bottom, high, wrap))
        else:
            solids.append(panel(rng, slat, start=bottom, end=high))
    return solids


def _bent_slat(s: BackSpace, start: float, end: float, wrap: float) -> Sheet:
    profile = np.array([s.at(0, f, wrap)[[2, 1]] for f in (end, (start + end) / 2, start)])
    return Sheet(profile=profile, thickness=s.thickness, half_width=np.full(3, s.hx), bend=np.full(3, -wrap))


def spindles(rng: Rng, s: BackSpace) -> list[Solid]:
    """Upright sticks under a top rail, in a frame or fanned out."""
    count, radius = rng.count(2, 8), rng.between(0.006, 0.012)
    start = rng.pick([-0.02, -0.02, rng.between(0.1, 0.3)])
    rail = rng.between(0.08, 0.22)
    fan_out, framed = rng.between(0.75, 1.0), rng.chance(0.7)
    flat = rng.chance(0.3)
    solids: list[Solid] = posts(rng, s, radius=radius * 1.6) if framed else []
    top = BackSpace(s.hx, s.z, s.low, s.high, s.lean, rng.between(0.016, 0.03))
    wrap = rng.between(0.0, 0.05) if rng.chance(0.4) else 0.0
    solids.append(curved(rng, top, start=1 - rail, end=1.0, wrap=wrap) if wrap else panel(rng, top, start=1 - rail))
    if start > 0:
        solids.append(panel(rng, top, start=start - 0.06, end=start))
    for x in np.linspace(-1, 1, count) * (s.hx - 0.03 if framed else s.hx * 0.9):
        ends = np.stack([s.at(x * fan_out, start), s.at(x, 1 - rail / 2, wrap * (x / s.hx) ** 2)])
        if flat:
            half = vector(rng.between(0.012, 0.03), s.length * (1 - rail / 2 - start) / 2, 0.006)
            solids.append(Box(center=ends.mean(0), half=half, rotation=s.rotation))
        else:
            solids.append(Tube(path=ends, radius=radius))
    return solids


def frame_gap(rng: Rng, s: BackSpace) -> list[Solid]:
    """Uprights with one panel or padding high up and an open gap above the seat."""
    gap = rng.between(0.15, 0.55)
    solids: list[Solid] = posts(rng, s, radius=rng.between(0.008, 0.022), high=rng.between(0.8, 1.0))
    if rng.chance(0.5):
        return [*solids, curved(rng, s, start=gap)]
    return [*solids, panel(rng, s, start=gap)]


def crossed(rng: Rng, s: BackSpace) -> list[Solid]:
    """A frame with an X in it."""
    radius = rng.between(0.012, 0.02)
    x, low, high = s.hx - radius, rng.between(0.1, 0.35), rng.between(0.75, 0.9)
    solids = posts(rng, s, radius=radius)
    solids += [Tube(path=np.stack([s.at(-k * x, low), s.at(k * x, high)]), radius=radius * 0.8) for k in (-1, 1)]
    for f in (low, high, 1.0):
        solids.append(Tube(path=np.stack([s.at(-x, f), s.at(x, f)]), radius=radius))
    return solids


def hoop(rng: Rng, s: BackSpace) -> list[Solid]:
    """A bent round frame, empty, with sticks, or filled by a padded oval."""
    angle = np.linspace(0, np.pi, 15)
    radius = rng.between(0.01, 0.018)
    shoulder = rng.between(0.4, 0.75)
    path = [
        s.at(s.hx, 0.0),
        *[s.at(s.hx * np.cos(a), shoulder + (1 - shoulder) * np.sin(a)) for a in angle],
        s.at(-s.hx, 0.0),
    ]
    solids: list[Solid] = [Tube(path=np.stack(path), radius=radius)]
    style = rng.pick(["sticks", "pad", "inner"])
    if style == "sticks":
        for x in np.linspace(-0.6, 0.6, rng.count(2, 5)) * s.hx:
            solids.append(Tube(path=np.stack([s.at(x, 0.0), s.at(x, 0.9)]), radius=radius * 0.6))
    elif style == "pad":
        half = vector(s.hx - radius, s.length * 0.33, max(s.thickness / 2, 0.015))
        solids.append(
            Pillow(center=s.at(0, 0.62), half=half[[0, 2, 1]], rotation=s.rotation @ turn_x(np.pi / 2), plan=2.5)
        )
    else:
        inner = [s.at(p[0] * 0.6, (p[1] - s.low) / (s.high - s.low) * 0.85) for p in path]
        solids.append(Tube(path=np.stack(inner), radius=radius * 0.8))
    return solids


def splat(rng: Rng, s: BackSpace) -> list[Solid]:
    """A frame with one broad upright board in the middle."""
    radius = rng.between(0.012, 0.022)
    middle = BackSpace(rng.between(0.05, 0.11), s.z, s.low, s.high, s.lean, rng.between(0.01, 0.02))
    rail = BackSpace(s.hx, s.z, s.low, s.high, s.lean, radius * 2)
    return [
        *posts(rng, s, radius=radius),
        panel(rng, middle),
        panel(rng, rail, start=0.85, end=rng.between(0.95, 1.1)),
    ]


def padded(rng: Rng, s: BackSpace) -> list[Solid]:
    """A thick upholstered back, at times with a frame behind or a pillow in front."""
    thick = max(s.thickness, 0.05)
    deep = BackSpace(s.hx, s.z, s.low, s.high, s.lean, thick)
    if rng.chance(0.4):
        half = vector(s.hx, s.length / 2, thick * 0.7)
        cushion = Pillow(
            center=s.at(0, 0.5), half=half[[0, 2, 1]], rotation=s.rotation @ turn_x(np.pi / 2), plan=rng.between(4, 8)
        )
        return [cushion]
    return [panel(rng, deep)]


STYLES = (panel, curved, ladder, spindles, frame_gap, crossed, hoop, splat, padded)
CHAIR_WEIGHTS = (0.17, 0.2, 0.15, 0.11, 0.12, 0.04, 0.07, 0.04, 0.1)


def any_back(rng: Rng, s: BackSpace) -> list[Solid]:
    """One of all styles, as often as on real chairs."""
    style = STYLES[int(rng.generator.choice(len(STYLES), p=CHAIR_WEIGHTS))]
    made = style(rng, s)
    return made if isinstance(made, list) else [made]
