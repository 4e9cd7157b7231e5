"""World geometry → the shape's samples and the dense surface behind its distance grid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial import cKDTree

from roam_goalpose.objects.errors import ObjectError
from roam_goalpose.objects.geometry import Array, Geometry
from roam_goalpose.objects.surfaces.sampling import (
    Samples,
    sample_cloud,
    sample_triangles,
    shuffled_subset,
)
from roam_goalpose.objects.surfaces.voxels import Surface

SAMPLE_COUNT = 20_000
_DENSE_LEAST, _DENSE_MOST = 40_000, 160_000
_SAMPLES_PER_CELL = 4.0
_STEP = 2000  # of sample counts, so that rounding does not change them
_SEED = 0  # the same for all: a turned upload has the turned samples
_LOOKED_AT = 10_000  # samples that decide about axes and size
_NEIGHBOURS = 12  # of a cloud point, to lay a plane through


@dataclass(frozen=True)
class LocalPlanes:
    """Unit normals `[N, 3]` of either sign, and the usual distance between neighbouring points."""

    normals: Array
    spacing: float


@lru_cache(maxsize=1)
def surface_samples(geometry: Geometry) -> tuple[Array, Array]:
    """Shuffled samples `[N, 3]` of the surface and their unit normals of either sign, in the geometry's own unit.

    Kept for the geometry at hand, which several decisions look at; `surface_samples.cache_clear` lets go of it.
    """
    if geometry.faces is None:
        size = max(float(np.ptp(geometry.vertices, axis=0).max()), 1e-12)
        points = sample_cloud(geometry.vertices / size, _LOOKED_AT, seed=_SEED).points * size
        return points, local_normals(points).normals
    triangles, areas = geometry.triangles, geometry.areas
    if not float(areas.sum()) > 0:
        raise _no_area()
    dense = sample_triangles(triangles, areas, _LOOKED_AT, seed=_SEED)
    samples = shuffled_subset(dense, _LOOKED_AT, seed=_SEED)
    assert samples.normals is not None
    return samples.points, samples.normals


def sample_surface(geometry: Geometry, pitch: float, areas: Array | None = None) -> tuple[Samples, Surface]:
    """Samples for everyone (at most `SAMPLE_COUNT`, shuffled) and dense ones for a grid of `pitch` (same unit).

    Raises:
        ObjectError: OBJECT_EMPTY when all triangles are degenerate.
    """
    if geometry.faces is None:
        return _cloud_surface(geometry)
    return _mesh_surface(geometry, pitch, geometry.areas if areas is None else areas)


def local_normals(points: Array) -> LocalPlanes:
    """Planes through the nearest neighbours of every point `[N, 3]`."""
    distances, neighbours = cKDTree(points).query(points, k=_NEIGHBOURS)
    centred = points[neighbours] - points[neighbours].mean(axis=1, keepdims=True)
    _, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", centred, centred))
    return LocalPlanes(vectors[:, :, 0], float(np.percentile(np.asarray(distances)[:, 4], 90)))


def _cloud_surface(cloud: Geometry) -> tuple[Samples, Surface]:
    samples = sample_cloud(cloud.vertices, SAMPLE_COUNT, seed=_SEED)
    planes = local_normals(samples.points)
    return samples, Surface(samples.points.astype(np.float32), planes.normals.astype(np.float32), planes.spacing)


def _mesh_surface(mesh: Geometry, pitch: float, areas: Array) -> tuple[Samples, Surface]:
    triangles = mesh.triangles
    area = float(areas.sum())
    if not area > 1e-6:
        raise _no_area()
    count = int(np.clip(area / pitch**2 * _SAMPLES_PER_CELL, _DENSE_LEAST, _DENSE_MOST)) // _STEP * _STEP
    dense = sample_triangles(triangles, areas, count, seed=_SEED)
    assert dense.normals is not None
    surface = Surface(dense.points.astype(np.float32), dense.normals.astype(np.float32), float(np.sqrt(area / count)))
    return shuffled_subset(dense, SAMPLE_COUNT, seed=_SEED), surface


def _no_area() -> ObjectError:
    return ObjectError(
        "OBJECT_EMPTY",
        field="content",
        message="All triangles are degenerate: the surface has no area.",
        remedy="Check the object in a 3D program and export it again.",
    )
