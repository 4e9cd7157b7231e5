"""The yaw of an object's own axes: a frame that turns with the upload, for grids and searches that have axes.

The walls of furniture follow the smallest rectangle around its footprint; which of the rectangle's four sides is the
front, the heights say: backs are high. Everything is exact over the triangles, not sampled, so that a turned upload
gives the turned frame. A round stool has no such axes: any frame is as good there as any other, and none comes back
the same.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from goalpose.objects.geometry import Array, Indices

_AS_SMALL = 1.01  # rectangles whose area is within this factor of the smallest are as good
_LEANS = 0.02  # share of its size by which the object must be higher on one side to have a front
_MOST_CORNERS = 512  # of the footprint's hull: a turned round plate has thousands


def canonical_yaw(vertices: Array, faces: Indices | None) -> float:
    """Yaw [rad] by which the object's own axes, its front along +Z, are turned about +Y.

    Args:
        vertices: `[V, 3]` metres, +Y up.
        faces: `[F, 3]` indices, None for a point cloud.
    """
    rectangles = _rectangles(vertices[:, ::2])
    backwards = _leaning(*_mass(vertices, faces))
    yaws = (rectangles[:, None] + 0.5 * np.pi * np.arange(4)).ravel()
    fronts = np.stack([np.sin(yaws), np.cos(yaws)], axis=-1)
    return float(np.remainder(yaws[np.argmin(fronts @ backwards)], 2 * np.pi))


def _rectangles(footprint: Array) -> Array:
    """Yaws [rad] of the smallest rectangle around points `[V, 2]` (x, z) and of those hardly larger."""
    try:
        hull = footprint[ConvexHull(footprint).vertices]
    except QhullError:  # all on one line
        hull = footprint[[footprint[:, 0].argmin(), footprint[:, 0].argmax()]]
    edges = np.roll(hull, -1, axis=0) - hull
    longest = np.argsort(-np.einsum("ij,ij->i", edges, edges), kind="stable")[:_MOST_CORNERS]
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
    """Horizontal direction `[2]` (x, z) in which the surface is higher; 0 where it is not clear."""
    share = weights / weights.sum()
    centred = points - share @ points
    spread = np.sqrt(share @ (centred * centred))
    lean = (share * centred[:, 1]) @ centred[:, ::2]
    clear = np.linalg.norm(lean) > _LEANS * spread[1] * np.hypot(spread[0], spread[2])
    return np.asarray(lean) if clear else np.zeros(2)
