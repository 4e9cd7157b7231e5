"""A floor under a scanned object, and walls beside it: found as planes that reach beyond the object, and cut off.

A floor ends the object (everything else is on one side of it) and goes on around it on nearly all sides. So does the
plate of a stool that stands on its head: but what is left there are legs, which look unlike all furniture, as the
deviation of `placing.size` says.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError

from roam_goalpose.objects.geometry import Array
from roam_goalpose.objects.placing.size import describe_shape, expected_size
from roam_goalpose.objects.placing.tilt import turn_to_y

Mask = npt.NDArray[np.bool_]

_THICK = 0.015  # of the diagonal: how far a floor's points are from its plane at most
_THIN = 0.003  # the same at least
_NOISE = 7.0  # times the median distance of a floor's points from its plane: its thickness
_LEAST_SHARE = 0.04  # of the points that a floor has
_LEAST_REST = 0.03  # of the points that are no floor
_BINS = 24  # directions around the object
_AROUND = 0.7  # of them in which the floor goes on
_BEYOND = 0.25  # of the object's footprint: how much the floor covers beside it
_CELLS = 15  # along the root of the object's footprint
_SIDEWAYS = 0.2  # cosine to the vertical of what is a wall
# A wall goes on to the left, to the right and above; the back of a chair only above its seat, if anywhere.
_WALL_AROUND, _WALL_BEYOND = 0.5, 0.8
_APART = np.cos(np.radians(10))
_PLANES = 3  # directions of flat areas that are looked at, besides the axes


@dataclass(frozen=True, eq=False)
class Floor:
    """A plane under an object.

    Attributes:
        up: `[3]` unit, away from the floor.
        height: of the plane along `up`.
        thickness: what is within it of the plane is floor.
        beyond: area that it covers beside the object, over the object's footprint.
    """

    up: Array
    height: float
    thickness: float
    beyond: float

    def covers(self, points: Array) -> Mask:
        """Which of points `[..., 3]` are floor, or below it."""
        mask: Mask = points @ self.up < self.height + self.thickness
        return mask


def find_floors(points: Array, normals: npt.NDArray[np.floating], *, up: Array | None) -> list[Floor]:
    """Planes that may be the floor under samples `[N, 3]` with normals of either sign; `up` `[3]` if it is known."""
    directions = [up] if up is not None else list(_directions(normals))
    return [floor for way in directions if (floor := _floor_along(points, way)) is not None]


def strangeness(points: Array, normals: npt.NDArray[np.floating], *, up: Array | None) -> float:
    """How unlike all known furniture samples look with `up` up, or whichever way they look best."""
    directions = [up] if up is not None else list(_directions(normals))
    return min(expected_size(describe_shape(points, normals, turn_to_y(way))).deviation for way in directions)


def find_walls(points: Array, normals: npt.NDArray[np.floating], *, up: Array) -> list[Floor]:
    """Upright planes that end the samples at a side and go on beside the object and above it."""
    upright = normals[np.abs(normals @ up) < _SIDEWAYS]
    if len(upright) < 50:
        return []
    walls = []
    for way in _directions(upright):
        if abs(float(way @ up)) < _SIDEWAYS:
            wall = _floor_along(points, way, around=_WALL_AROUND, least=_WALL_BEYOND)
            if wall is not None:
                walls.append(wall)
    return walls


def _directions(normals: npt.NDArray[np.floating]) -> Iterator[Array]:
    """Both ways along the axes and along the normals of the largest flat areas."""
    found = list(np.eye(3))
    left = np.asarray(normals, np.float64)
    for _ in range(_PLANES):
        if len(left) < 50:
            break
        seeds = left[:: max(len(left) // 200, 1)]
        near = np.abs(seeds @ left.T) > _APART
        seed = seeds[int(near.sum(axis=1).argmax())]
        members = left[np.abs(left @ seed) > _APART]
        mean = (members * np.sign(members @ seed)[:, None]).mean(axis=0)
        mean /= np.linalg.norm(mean)
        if all(abs(float(mean @ one)) < np.cos(np.radians(2)) for one in found):
            found.append(mean)
        left = left[np.abs(left @ seed) <= _APART]
    for axis in found:
        yield axis
        yield -axis


def _floor_along(points: Array, up: Array, *, around: float = _AROUND, least: float = _BEYOND) -> Floor | None:
    """The plane that ends the points below, if it goes on around what stands on it."""
    heights = points @ up
    thickness = _THICK * float(np.linalg.norm(np.ptp(points, axis=0)))
    lowest = float(np.quantile(heights, 0.002))
    slab = heights < lowest + 2 * thickness
    if not slab.any():
        return None
    height = float(np.median(heights[slab]))
    noise = _NOISE * float(np.median(np.abs(heights[slab] - height)))
    thickness = float(np.clip(noise, thickness * _THIN / _THICK, thickness))
    slab = heights < height + thickness
    share = float(slab.mean())
    if share < _LEAST_SHARE or share > 1 - _LEAST_REST:
        return None
    flat = points @ turn_to_y(up)[[0, 2]].T
    share, beyond = _beyond(flat[slab], flat[~slab])
    return Floor(up, height, thickness, beyond) if share >= around and beyond >= least else None


def _beyond(slab: Array, rest: Array) -> tuple[float, float]:
    """The share of directions in which `slab` `[N, 2]` goes on beside `rest` `[M, 2]`, and the area that it covers
    there over the footprint of `rest`."""
    try:
        hull = ConvexHull(rest)
    except QhullError:
        return 0.0, 0.0
    side = float(np.sqrt(hull.volume))
    outside = (slab @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=1) > 0.04 * side
    if not outside.any():
        return 0.0, 0.0
    rays = slab[outside] - rest[hull.vertices].mean(axis=0)
    bins = np.floor((np.arctan2(rays[:, 1], rays[:, 0]) / (2 * np.pi) + 0.5) * _BINS).astype(int) % _BINS
    cells = np.unique(np.floor(slab[outside] / (side / _CELLS)).astype(np.int64), axis=0)
    return len(np.unique(bins)) / _BINS, len(cells) / _CELLS**2
