"""Implicit solids: signed distances that are right near the surface, negative inside [m].

Each solid is a function of points [N, 3] in the frame that its numbers are given in. Ellipsoids and swept ellipses use
the first-order distance k0 (k0 − 1) / k1 of Quilez (iquilezles.org, "ellipsoid SDF").
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

Solid = Callable[[np.ndarray], np.ndarray]


def ellipsoid(centre: Sequence[float], half: Sequence[float], *, tilt: float = 0.0) -> Solid:
    """Half axes [m]; `tilt` turns it about x [rad]."""
    middle, axes = np.asarray(centre, float), np.asarray(half, float)
    cos, sin = np.cos(tilt), np.sin(tilt)
    turn = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])

    def distance(points: np.ndarray) -> np.ndarray:
        return _scaled((points - middle) @ turn, axes)

    return distance


def _scaled(local: np.ndarray, axes: np.ndarray) -> np.ndarray:
    k0 = np.linalg.norm(local / axes, axis=-1)
    k1 = np.linalg.norm(local / axes**2, axis=-1)
    return np.asarray(np.where(k0 > 1e-6, k0 * (k0 - 1) / np.maximum(k1, 1e-9), -np.min(axes)))


def sweep(stations: Sequence[Sequence[float]], across: Sequence[float] = (1, 0, 0), *, density: int = 5) -> Solid:
    """Ellipses along a line. A station is x, y, z, half width along `across`, half depth; rounded ends [m]."""
    table = np.asarray(stations, float)
    if len(table) > 2:
        along = np.arange(len(table), dtype=float)
        table = PchipInterpolator(along, table)(np.linspace(0, along[-1], density * (len(table) - 1) + 1))
    side = np.asarray(across, float)

    def distance(points: np.ndarray) -> np.ndarray:
        best = np.full(len(points), np.inf)
        for start, end in pairwise(table):
            axis = end[:3] - start[:3]
            length = float(np.linalg.norm(axis))
            axis = axis / length
            u = side - axis * (side @ axis)
            u /= np.linalg.norm(u)
            offset = points - start[:3]
            raw = offset @ axis
            share = np.clip(raw / length, 0, 1)
            half = start[3:] + share[:, None] * (end[3:] - start[3:])
            rest = raw - share * length
            local = np.stack([offset @ u, offset @ np.cross(axis, u), rest], axis=-1)
            best = np.minimum(best, _scaled(local, np.column_stack([half, half.min(axis=-1)])))
        return best

    return distance


def capsule(start: Sequence[float], end: Sequence[float], radius: float, tip: float | None = None) -> Solid:
    """A round rod whose radius goes from `radius` to `tip` [m]."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    last = radius if tip is None else tip

    def distance(points: np.ndarray) -> np.ndarray:
        axis = b - a
        share = np.clip((points - a) @ axis / (axis @ axis), 0, 1)
        return np.linalg.norm(points - a - share[:, None] * axis, axis=-1) - (radius + share * (last - radius))

    return distance


def seen_from_front(path: Sequence[Sequence[float]], behind: float) -> Solid:
    """A stroke (x, y, radius) drawn in the picture from the front, all the way back to z = `behind` [m]."""
    strokes = [capsule((x, y, 0), (u, v, 0), r, s) for (x, y, r), (u, v, s) in pairwise(path)]
    flat = blend(strokes, 0.001)
    return lambda points: np.maximum(flat(points * np.array([1.0, 1, 0])), behind - points[:, 2])


def half_space(point: Sequence[float], outward: Sequence[float]) -> Solid:
    """Everything behind a plane."""
    origin, normal = np.asarray(point, float), np.asarray(outward, float) / np.linalg.norm(outward)

    def distance(points: np.ndarray) -> np.ndarray:
        return np.asarray((points - origin) @ normal)

    return distance


def blend(solids: Sequence[Solid], radius: float) -> Solid:
    """Union with fillets of about `radius` [m] (the polynomial smooth minimum)."""

    def distance(points: np.ndarray) -> np.ndarray:
        found = solids[0](points)
        for other in solids[1:]:
            found = smooth_minimum(found, other(points), radius)
        return found

    return distance


def carve(solid: Solid, tool: Solid, radius: float) -> Solid:
    """`solid` without `tool`, the edge rounded by about `radius` [m]."""
    return lambda points: -smooth_minimum(-solid(points), tool(points), radius)


def common(solid: Solid, *regions: Solid, radius: float = 0.003) -> Solid:
    """What lies in all of them, edges rounded by about `radius` [m]."""

    def distance(points: np.ndarray) -> np.ndarray:
        found = solid(points)
        for region in regions:
            found = -smooth_minimum(-found, -region(points), radius)
        return found

    return distance


def thicker(solid: Solid, by: float) -> Solid:
    """The solid grown by so much on every side [m]."""
    return lambda points: solid(points) - by


def mirrored(solid: Solid) -> Solid:
    """The solid reflected at x = 0."""
    return lambda points: solid(points * np.array([-1.0, 1, 1]))


def smooth_minimum(a: np.ndarray, b: np.ndarray, radius: float) -> np.ndarray:
    """The lesser of two, rounded where they differ by less than `radius`."""
    share = np.maximum(radius - np.abs(a - b), 0) / radius
    return np.asarray(np.minimum(a, b) - share**2 * radius / 4)
