"""The yaw of an object's own axes: a frame that turns with the upload, for grids and searches that have axes.

The walls of furniture follow the smallest rectangle around its footprint; which of the rectangle's four sides is the
front, the heights say: backs are high. Everything is exact over the triangles, not sampled, so that a turned upload
gives the turned frame. Where front and back are alike any side will do, but it must be the same one again: the side to
which the outline is skewed, and where it is symmetric that of what comes later in the file: no turn changes its order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from roam_goalpose.objects.geometry import Array, Indices

_AS_SMALL = 1.01  # rectangles whose area is within this factor of the smallest are as good
_LEVEL, _LEANING = 0.02, 0.05  # correlation of height and place: none at all; that of the flattest backs
_SHORTEST_EDGE = 0.02  # of the longest
_ORDER = 0.01  # what the order in the file counts beside the skew of the outline, which is about 0.1 without symmetry
_MOST_CORNERS = 512  # of the footprint's hull: a turned round plate has thousands


@dataclass(frozen=True)
class Heading:
    """The object's own axes: its front along +Z of them."""

    yaw: float  # by which they are turned about the world's +Y [rad]
    clarity: float  # from 0, front and back are alike, to 1


def find_heading(vertices: Array, faces: Indices | None) -> Heading:
    """The own axes of an object of `vertices` `[V, 3]` [m], +Y up, and `faces` `[F, 3]` (None for a point cloud)."""
    rectangles = _rectangles(vertices[:, ::2])
    points, weights = _mass(vertices, faces)
    backwards = _leaning(points, weights)
    clarity = float(np.clip((np.linalg.norm(backwards) - _LEVEL) / (_LEANING - _LEVEL), 0.0, 1.0))
    yaws = (rectangles[:, None] + 0.5 * np.pi * np.arange(4)).ravel()
    best = _most_opposite(yaws, backwards if clarity else -_odd_side(points, weights))
    return Heading(float(np.remainder(yaws[best], 2 * np.pi)), clarity)


def _most_opposite(yaws: Array, backwards: Array) -> int:
    """Which yaw faces away from `backwards`; of two as good, left and right of it, the left one."""
    apart = np.remainder(yaws - np.arctan2(-backwards[0], -backwards[1]) + np.pi, 2 * np.pi) - np.pi
    as_good = np.abs(apart) < np.abs(apart).min() + 1e-4
    return int(np.argmax(np.where(as_good, apart, -np.inf)))


def _rectangles(footprint: Array) -> Array:
    """Yaws [rad] of the smallest rectangle around points `[V, 2]` (x, z) and of those hardly larger."""
    try:
        hull = footprint[ConvexHull(footprint).vertices]
    except QhullError:  # all on one line
        hull = footprint[[footprint[:, 0].argmin(), footprint[:, 0].argmax()]]
    edges = np.roll(hull, -1, axis=0) - hull
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    longest = np.argsort(-lengths, kind="stable")[:_MOST_CORNERS]
    longest = longest[lengths[longest] > _SHORTEST_EDGE * lengths.max()]  # shorter ones point anywhere
    yaw = np.arctan2(edges[longest, 0], edges[longest, 1])
    along = np.stack([np.sin(yaw), np.cos(yaw)])
    across = np.stack([np.cos(yaw), -np.sin(yaw)])
    area = np.ptp(hull @ along, axis=0) * np.ptp(hull @ across, axis=0)
    kept: Array = yaw[area <= _AS_SMALL * area.min()]
    return kept


def _mass(vertices: Array, faces: Indices | None) -> tuple[Array, Array]:
    """Points and weights that integrate quadratic functions over the surface: the middles of the triangles' edges."""
    if faces is None:
        return vertices, np.ones(len(vertices))
    corners = vertices[faces]
    middles = 0.5 * (corners + np.roll(corners, 1, axis=1))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.sqrt(np.einsum("fi,fi->f", normals, normals))
    return middles.reshape(-1, 3), np.repeat(areas, 3)


def _leaning(points: Array, weights: Array) -> Array:
    """Horizontal direction `[2]` (x, z) in which the surface is higher, as long as height and place are correlated."""
    share = weights / weights.sum()
    centred = points - share @ points
    spread = np.sqrt(share @ (centred * centred))
    lean: Array = (share * centred[:, 1]) @ centred[:, ::2]
    return lean / max(spread[1] * np.hypot(spread[0], spread[2]), 1e-12)


def _odd_side(points: Array, weights: Array) -> Array:
    """A horizontal direction `[2]` (x, z) that turns with the object: that of its skew and of its order in the file."""
    share = weights / weights.sum()
    flat = points[:, ::2] - share @ points[:, ::2]
    spread = np.sqrt(share @ np.einsum("pi,pi->p", flat, flat))
    flat = flat / max(spread, 1e-12)
    skew = (share * np.einsum("pi,pi->p", flat, flat)) @ flat
    order = (share * np.linspace(-1.0, 1.0, len(flat))) @ flat
    side: Array = skew + _ORDER * order
    return side
