"""The way from uploaded bytes to a `Shape`, in one process. Servers use `isolation` around it."""

from __future__ import annotations

import hashlib

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from goalpose.objects.axes import check_up, up_rotation
from goalpose.objects.errors import ObjectError
from goalpose.objects.geometry import Array, Geometry
from goalpose.objects.limits import Limits
from goalpose.objects.reading import read_geometry
from goalpose.objects.sampling import (
    Samples,
    content_seed,
    sample_cloud,
    sample_triangles,
    shuffled_subset,
    triangle_areas,
)
from goalpose.objects.shape import Shape, ShapeWarning
from goalpose.objects.units import check_unit, choose_unit
from goalpose.objects.voxels import Surface, choose_pitch, signed_distance

SAMPLE_COUNT = 20_000
_DENSE_LEAST, _DENSE_MOST = 40_000, 200_000
_SAMPLES_PER_CELL = 5.0
_THINNEST = 0.02  # [m] a box thinner than this in two directions is a line, in one a sheet


def load_shape(
    data: bytes, format: str, *, unit: str | None = None, up: str | None = None, limits: Limits | None = None
) -> Shape:
    """Read an object file into metres, +Y up.

    Args:
        data: the whole file.
        format: one of `formats.FORMATS` (see `format_of`).
        unit: `m cm mm in ft`; detected when None.
        up: `y z x -y -z -x`; detected when None.
        limits: bounds on bytes and counts.

    Raises:
        ObjectError: a reason, the field at fault and a remedy.
    """
    unit = None if unit is None else check_unit(unit)
    up = None if up is None else check_up(up)
    geometry = read_geometry(data, format, limits or Limits())
    return shape_of(geometry, unit=unit, up=up)


def shape_of(geometry: Geometry, *, unit: str | None = None, up: str | None = None) -> Shape:
    """Bring raw geometry to metres and +Y up, sample it and build its distance grid."""
    warnings: list[ShapeWarning] = []
    extents = np.ptp(geometry.vertices, axis=0)
    guess = choose_unit(float(extents.max()), given=unit, hint=geometry.unit)
    if guess.doubt:
        warnings.append(ShapeWarning("OBJECT_UNIT_UNSURE", guess.doubt))
    _check_thickness(extents * guess.metres)
    up = up or geometry.up or "y"
    transform = np.eye(4)
    transform[:3, :3] = up_rotation(up) * guess.metres
    world = Geometry(geometry.vertices @ transform[:3, :3].T, geometry.faces)
    return _finish(world, transform, tuple(warnings))


def _finish(world: Geometry, transform: Array, warnings: tuple[ShapeWarning, ...]) -> Shape:
    bounds = np.stack([world.vertices.min(axis=0), world.vertices.max(axis=0)])
    pitch = choose_pitch(bounds[1] - bounds[0])
    samples, surface = _cloud_surface(world) if world.faces is None else _mesh_surface(world, pitch)
    points = samples.points.astype(np.float32)
    return Shape(
        name=_name(points, transform),
        points=points,
        normals=None if samples.normals is None else samples.normals.astype(np.float32),
        object_to_world=transform,
        floor_height=float(bounds[0, 1]),
        bounds=bounds,
        distance=signed_distance(surface, pitch=pitch, floor=float(bounds[0, 1])),
        mesh=None if world.faces is None else (world.vertices.astype(np.float32), world.faces.astype(np.int32)),
        warnings=warnings,
    )


def _mesh_surface(world: Geometry, pitch: float) -> tuple[Samples, Surface]:
    """The shape's samples and the denser ones behind its distance grid."""
    triangles = world.triangles
    areas = triangle_areas(triangles)
    area = float(areas.sum())
    if not area > 1e-6:
        raise _no_area()
    seed = content_seed(world)
    count = int(np.clip(area / pitch**2 * _SAMPLES_PER_CELL, _DENSE_LEAST, _DENSE_MOST))
    dense = sample_triangles(triangles, areas, count, seed=seed)
    assert dense.normals is not None
    surface = Surface(dense.points.astype(np.float32), dense.normals.astype(np.float32), float(np.sqrt(area / count)))
    return shuffled_subset(dense, SAMPLE_COUNT, seed=seed), surface


def _cloud_surface(world: Geometry) -> tuple[Samples, Surface]:
    """A cloud's own points; for the distance grid with normals by local planes."""
    samples = sample_cloud(world.vertices, SAMPLE_COUNT, seed=content_seed(world))
    points = samples.points
    distances, neighbours = cKDTree(points).query(points, k=12)
    centred = points[neighbours] - points[neighbours].mean(axis=1, keepdims=True)
    _, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", centred, centred))
    spacing = float(np.percentile(np.asarray(distances)[:, 4], 90))
    return samples, Surface(points.astype(np.float32), vectors[:, :, 0].astype(np.float32), spacing)


def _check_thickness(extents: Array) -> None:
    """Refuse lines and flat sheets: nothing can sit on them."""
    if np.sort(extents)[0] < _THINNEST:
        raise ObjectError(
            "OBJECT_TOO_FLAT",
            field="content",
            message=f"The object's box is {' x '.join(f'{e:.3f}' for e in extents)} m: flat, not furniture.",
            remedy="Send the whole object in three dimensions; check that no axis was lost in the export.",
        )


def _no_area() -> ObjectError:
    return ObjectError(
        "OBJECT_EMPTY",
        field="content",
        message="All triangles are degenerate: the surface has no area.",
        remedy="Check the object in a 3D program and export it again.",
    )


def _name(points: npt.NDArray[np.float32], transform: Array) -> str:
    digest = hashlib.sha256(points.astype("<f4").tobytes())
    digest.update(transform.astype("<f8").tobytes())
    return f"objects/sha256:{digest.hexdigest()}"
