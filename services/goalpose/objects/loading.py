"""The way from uploaded bytes to a `Shape`, in one process. Servers use `isolation` around it."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from goalpose.objects.axes import check_up, up_rotation
from goalpose.objects.errors import ObjectError
from goalpose.objects.geometry import Array, Geometry
from goalpose.objects.limits import Limits
from goalpose.objects.reading import read_geometry
from goalpose.objects.sampling import Samples
from goalpose.objects.shape import Shape, ShapeWarning
from goalpose.objects.surface import sample_surface
from goalpose.objects.units import check_unit, choose_unit
from goalpose.objects.upright import choose_up
from goalpose.objects.voxels import Surface, choose_pitch, signed_distance

_THINNEST = 0.02  # [m] no furniture's box is thinner
_FARTHEST = 1000.0  # [m] beyond this from the origin float32 points lose a tenth of a millimetre


def load_shape(
    data: bytes, format: str, *, unit: str | None = None, up: str | None = None, limits: Limits | None = None
) -> Shape:
    """Read an object file into metres, +Y up.

    Args:
        data: the whole file.
        format: one of `formats.FORMATS` (see `format_of`).
        unit: `m cm mm in ft`; detected when None.
        up: `y z x -y -z -x`; detected when None (glTF is Y-up by its specification, other formats Y or Z).
        limits: bounds on bytes and counts.

    Raises:
        ObjectError: a reason, the field at fault and a remedy.
    """
    unit = None if unit is None else check_unit(unit)
    up = None if up is None else check_up(up)
    geometry = read_geometry(data, format, limits or Limits())
    return shape_of(geometry, unit=unit, up=up)


def shape_of(geometry: Geometry, *, unit: str | None = None, up: str | None = None) -> Shape:
    """Bring raw geometry to metres and +Y up, sample it and build its distance grid; raises like `load_shape`."""
    warnings: list[ShapeWarning] = []
    unit_guess = choose_unit(float(np.ptp(geometry.vertices, axis=0).max()), given=unit, hint=geometry.unit)
    if unit_guess.doubt:
        warnings.append(ShapeWarning("OBJECT_UNIT_UNSURE", unit_guess.doubt))
    scaled = replace(geometry, vertices=geometry.vertices * unit_guess.metres)
    extents = np.ptp(scaled.vertices, axis=0)
    _check_box(scaled.vertices, extents)
    pitch = choose_pitch(extents)
    samples, surface = sample_surface(scaled, pitch)
    up = up or geometry.up
    if up is None:
        up_guess = choose_up(samples.points, surface.normals if samples.normals is None else samples.normals)
        up = up_guess.up
        if up_guess.doubt:
            warnings.append(ShapeWarning("OBJECT_UP_UNSURE", up_guess.doubt))
    rotation = up_rotation(up)
    transform = np.eye(4)
    transform[:3, :3] = rotation * unit_guess.metres
    return _assemble(scaled, samples, surface, rotation, transform, pitch, tuple(warnings))


def _assemble(
    scaled: Geometry,
    samples: Samples,
    surface: Surface,
    rotation: Array,
    transform: Array,
    pitch: float,
    warnings: tuple[ShapeWarning, ...],
) -> Shape:
    """Turn everything to +Y up and build the distance grid."""
    vertices = scaled.vertices @ rotation.T
    bounds = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
    turn = rotation.T.astype(np.float32)
    turned = Surface(surface.points @ turn, surface.normals @ turn, surface.spacing)
    points = (samples.points @ rotation.T).astype(np.float32)
    return Shape(
        name=_name(points, transform),
        points=points,
        normals=None if samples.normals is None else (samples.normals @ rotation.T).astype(np.float32),
        object_to_world=transform,
        floor_height=float(bounds[0, 1]),
        bounds=bounds,
        distance=signed_distance(turned, pitch=pitch, floor=float(bounds[0, 1])),
        mesh=None if scaled.faces is None else (vertices.astype(np.float32), scaled.faces.astype(np.int32)),
        warnings=warnings,
    )


def _check_box(vertices: Array, extents: Array) -> None:
    """Refuse flat sheets and lines (nothing can sit on them) and objects lost far from their origin."""
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
