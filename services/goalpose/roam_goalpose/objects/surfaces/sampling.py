"""Surface samples: deterministic, spread by area, in an order whose every beginning is itself a fair sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roam_goalpose.objects.arrays import Array
from roam_goalpose.objects.geometry import area_vectors

# Fractional parts of the powers of the plastic number: the two-dimensional additive sequence with the evenest spread.
_R2 = np.array([0.7548776662466927, 0.5698402909980532])
_CLOUD_CELL = 0.02  # [m] within a cell of this size cloud points share their weight


@dataclass(frozen=True)
class Samples:
    """Points on a surface.

    Attributes:
        points: `[N, 3]`.
        normals: `[N, 3]` unit, from the winding of the triangles (not made consistent); None for a point cloud.
    """

    points: Array
    normals: Array | None


def sample_triangles(triangles: Array, areas: Array, count: int, *, seed: int) -> Samples:
    """`count` points spread by area over triangles `[F, 3, 3]`, in the order of the triangles.

    The cumulated area is cut into `count` equal pieces with one point in each, so a triangle's number of points is
    never more than one off its fair share; within triangles the points follow a low-discrepancy sequence.
    """
    cumulated = np.cumsum(areas)
    rng = np.random.default_rng(seed)
    targets = (np.arange(count) + rng.random(count)) * (cumulated[-1] / count)
    chosen = np.minimum(np.searchsorted(cumulated, targets, side="right"), len(triangles) - 1)
    # Each triangle has the sequence from its own random start: one start for all would alias with regular meshes.
    uv = (rng.random((len(triangles), 2))[chosen] + np.arange(count)[:, None] * _R2) % 1.0
    u, v = uv[:, :1], uv[:, 1:]
    folded = u + v > 1.0
    u, v = np.where(folded, 1.0 - u, u), np.where(folded, 1.0 - v, v)
    corners = triangles[chosen]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals = area_vectors(triangles)[chosen] if len(triangles) < count else np.cross(first, second)
    normals /= np.maximum(np.sqrt(np.einsum("fi,fi->f", normals, normals)), 1e-30)[:, None]
    return Samples(corners[:, 0] + u * first + v * second, normals)


def shuffled_subset(samples: Samples, count: int, *, seed: int) -> Samples:
    """`count` of the samples at even steps, in random order: any first n of them are spread by area too."""
    steps = (np.arange(count) + 0.5) * (len(samples.points) / count)
    chosen = np.random.default_rng(seed).permutation(steps.astype(np.intp))
    return Samples(samples.points[chosen], None if samples.normals is None else samples.normals[chosen])


def sample_cloud(points: Array, count: int, *, seed: int) -> Samples:
    """At most `count` of the points, in random order, dense regions thinned: scans are denser near the sensor."""
    cells = np.floor((points - points.min(axis=0)) / _CLOUD_CELL).astype(np.int64)
    rows = (cells * np.array([1 << 42, 1 << 21, 1])).sum(axis=1)
    _, inverse, sizes = np.unique(rows, return_inverse=True, return_counts=True)
    # Weighted sampling without replacement: the largest u^(1/w) win (Efraimidis and Spirakis 2006).
    keys = np.log(np.random.default_rng(seed).random(len(points))) * sizes[inverse]
    return Samples(points[np.argsort(-keys, kind="stable")[:count]], None)
