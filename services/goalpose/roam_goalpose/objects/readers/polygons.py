"""Polygons of any size, concave ones too, cut into triangles."""

from __future__ import annotations

import mapbox_earcut
import numpy as np

from roam_goalpose.objects.geometry import Array, Indices

_MOST_CORNERS = 100_000  # of one polygon: cutting takes quadratic time


def triangulate(vertices: Array, corners: Indices, sizes: Indices) -> Indices:
    """Triangles `[F, 3]` that cover polygons.

    Args:
        vertices: `[V, 3]`.
        corners: `[sum(sizes)]` vertex indices, polygon after polygon; those outside 0 … V - 1 stay as they are.
        sizes: `[P]` corners of each polygon; those with fewer than three are left out.

    Raises:
        ValueError: the counts do not agree, or a polygon has more corners than any program writes.
    """
    if sizes.sum() != len(corners) or (len(sizes) and sizes.min() < 0):
        raise ValueError("the polygons' sizes do not agree with their corners")
    starts = np.cumsum(sizes) - sizes
    triangles = corners[starts[sizes == 3][:, None] + np.arange(3)]
    quads = corners[starts[sizes == 4][:, None] + np.arange(4)]
    found = [(np.flatnonzero(sizes == 3), triangles)]
    if len(quads):
        first = np.flatnonzero(sizes == 4)
        found.append((np.repeat(first, 2), _split_quads(vertices, quads).reshape(-1, 3)))
    for polygon in np.flatnonzero(sizes > 4):
        size = sizes[polygon]
        if size > _MOST_CORNERS:
            raise ValueError(f"a polygon has {size} corners")
        cut = _cut(vertices, corners[starts[polygon] : starts[polygon] + size])
        found.append((np.full(len(cut), polygon), cut))
    if len(found) == 1:
        return triangles
    order = np.argsort(np.concatenate([polygon for polygon, _ in found]), kind="stable")
    cut_all: Indices = np.concatenate([part for _, part in found])[order]
    return cut_all


def _split_quads(vertices: Array, quads: Indices) -> Indices:
    """Two triangles `[Q, 2, 3]` each, along the diagonal that lies inside."""
    valid = np.logical_and.reduce((quads >= 0) & (quads < len(vertices)), axis=1)
    places = vertices[np.where(valid[:, None], quads, 0)]
    first = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    second = np.cross(places[:, 2] - places[:, 0], places[:, 3] - places[:, 0])
    folded = (np.einsum("qi,qi->q", first, second) < 0)[:, None]
    return np.stack(
        [
            np.where(folded, quads[:, [0, 1, 3]], quads[:, [0, 1, 2]]),
            np.where(folded, quads[:, [1, 2, 3]], quads[:, [0, 2, 3]]),
        ],
        axis=1,
    )


def _cut(vertices: Array, corners: Indices) -> Indices:
    """The triangles `[n - 2, 3]` of one polygon."""
    fan = np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], axis=1)
    if corners.min() < 0 or corners.max() >= len(vertices):
        return fan
    places = vertices[corners]
    if not np.isfinite(places).all():
        return fan
    rays = places - places[0]
    turns = np.cross(rays[1:-1], rays[2:])
    normal = turns.sum(axis=0)  # Newell: twice the area vector
    if (turns @ normal >= 0).all():
        return fan
    drop = int(np.abs(normal).argmax())
    flat = np.ascontiguousarray(np.delete(rays, drop, axis=1))
    cut = np.asarray(mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32)), np.int64).reshape(-1, 3)
    if not len(cut):
        return fan
    a, b, c = (flat[cut[:, k]] for k in range(3))
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum()
    ring = np.roll(flat, -1, axis=0)
    signed = (flat[:, 0] * ring[:, 1] - flat[:, 1] * ring[:, 0]).sum()
    return corners[cut if area * signed > 0 else cut[:, ::-1]]
