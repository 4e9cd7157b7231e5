"""The way from uploaded bytes to a `Shape`, in one process. Servers use `isolation` around it."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from roam_goalpose.objects.placing.axes import check_up
from roam_goalpose.objects.cleaning.clean import clean
from roam_goalpose.objects.distance import turn_about_y
from roam_goalpose.objects.errors import ObjectError
from roam_goalpose.objects.geometry import Array, Geometry
from roam_goalpose.objects.placing.heading import find_heading
from roam_goalpose.objects.limits import Limits
from roam_goalpose.objects.reading import read_geometry
from roam_goalpose.objects.shape import Shape, ShapeWarning
from roam_goalpose.objects.surfaces.surface import sample_surface
from roam_goalpose.objects.placing.place import place
from roam_goalpose.objects.placing.units import check_size, check_unit
from roam_goalpose.objects.surfaces.voxels import choose_pitch, signed_distance

_LEVEL = 0.999  # cosine of an axis that still is the floor's
_STANDS_ON = 0.08  # [m] at most between a floor that was cut off and what is left above it
_THINNEST = 0.02  # [m] no furniture's box is thinner
_FARTHEST = 1000.0  # [m] beyond this from the origin float32 points lose a tenth of a millimetre


def load_shape(
    data: bytes,
    format: str,
    *,
    unit: str | None = None,
    up: str | None = None,
    size: float | None = None,
    piece: str | None = None,
    limits: Limits | None = None,
) -> Shape:
    """Read an object file into metres, +Y up.

    Args:
        data: the whole file.
        format: one of `readers.FORMATS` (see `format_of`).
        unit: `m cm mm in ft`; when None as the file says, else detected.
        up: `y z x -y -z -x`; when None as the file says, else detected.
        size: height of the object in metres; goes before the unit.
        piece: name or index of the one to take from a file of several; the best seat when None.
        limits: bounds on bytes and counts.

    Raises:
        ObjectError: a reason, the field at fault and a remedy.
    """
    unit = None if unit is None else check_unit(unit)
    up = None if up is None else check_up(up)
    size = None if size is None else check_size(size)
    geometry = read_geometry(data, format, limits or Limits())
    return shape_of(geometry, unit=unit, up=up, size=size, piece=piece)


def shape_of(
    geometry: Geometry,
    *,
    unit: str | None = None,
    up: str | None = None,
    size: float | None = None,
    piece: str | None = None,
) -> Shape:
    """Bring raw geometry to metres and +Y up, sample it and build its distance grid; raises like `load_shape`."""
    cleaned = clean(geometry, up=up)
    geometry, floor = cleaned.geometry, cleaned.floor
    placing = place(geometry, unit=unit, up=up, size=size, level=None if floor is None else floor.up)
    world = replace(geometry, vertices=geometry.vertices @ (placing.rotation * placing.metres).T)
    _check_box(world.vertices)
    transform = np.eye(4)
    transform[:3, :3] = placing.rotation * placing.metres
    level = None
    if floor is not None and float(placing.rotation[1] @ floor.up) > _LEVEL:
        level = floor.height * placing.metres
    return _assemble(world, transform, (*geometry.notes, *placing.warnings), level)


def _assemble(
    world: Geometry, transform: Array, warnings: tuple[ShapeWarning, ...], level: float | None = None
) -> Shape:
    """Sample geometry in metres and +Y up, and build its distance grid, both in the object's own axes.

    An upload turned about +Y then has the same samples and the same grid, turned.
    """
    heading = find_heading(world.vertices, world.faces)
    axes = turn_about_y(heading.yaw)
    own = world.vertices @ axes
    box = np.stack([own.min(axis=0), own.max(axis=0)])
    pitch = choose_pitch(box[1] - box[0])
    samples, surface = sample_surface(replace(world, vertices=own), pitch)
    points = (samples.points @ axes.T).astype(np.float32)
    bounds = np.stack([world.vertices.min(axis=0), world.vertices.max(axis=0)])
    floor = float(bounds[0, 1])
    if level is not None and abs(level - floor) < _STANDS_ON:
        floor = level
    return Shape(
        name=_name(points, transform),
        points=points,
        normals=None if samples.normals is None else (samples.normals @ axes.T).astype(np.float32),
        object_to_world=transform,
        floor_height=floor,
        bounds=bounds,
        distance=signed_distance(surface, box=box, pitch=pitch, floor=floor, yaw=heading.yaw),
        front=axes @ np.array([0.0, 0.0, heading.clarity]),
        mesh=None if world.faces is None else (world.vertices.astype(np.float32), world.faces.astype(np.int32)),
        warnings=warnings,
    )


def _check_box(vertices: Array) -> None:
    """Refuse flat sheets and lines (nothing can sit on them) and objects lost far from their origin."""
    extents = np.ptp(vertices, axis=0)
    if extents.min() < _THINNEST:
        raise ObjectError(
            "OBJECT_TOO_FLAT",
            field="content",
            message=f"The object's box is {' x '.join(f'{e:.3f}' for e in extents)} m: flat, not furniture.",
            remedy="Send the whole object in three dimensions; check that no axis was lost in the export.",
        )
    farthest = float(np.abs(vertices).max())
    if farthest > _FARTHEST:
        raise ObjectError(
            "OBJECT_FAR_AWAY",
            field="content",
            message=f"The object lies {farthest:.0f} m from its origin; at most {_FARTHEST:.0f} m keep precision.",
            remedy="Move it near the origin before exporting.",
        )


def _name(points: npt.NDArray[np.float32], transform: Array) -> str:
    digest = hashlib.sha256(points.astype("<f4").tobytes())
    digest.update(transform.astype("<f8").tobytes())
    return f"objects/sha256:{digest.hexdigest()}"
