"""The way from uploaded bytes to a `Shape`, in one process. Servers use `isolation` around it."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from roam_character.distance import turn_about_y

from roam_goalpose.objects.axes import check_up, up_rotation
from roam_goalpose.objects.errors import ObjectError
from roam_goalpose.objects.geometry import Array, Geometry
from roam_goalpose.objects.heading import find_heading
from roam_goalpose.objects.limits import Limits
from roam_goalpose.objects.reading import read_geometry
from roam_goalpose.objects.shape import Shape, ShapeWarning
from roam_goalpose.objects.surface import sample_surface
from roam_goalpose.objects.tilt import FARTHEST, Tilt, find_tilt, stands, surface_centre
from roam_goalpose.objects.units import check_unit, choose_unit
from roam_goalpose.objects.upright import choose_up
from roam_goalpose.objects.voxels import choose_pitch, signed_distance

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
    _check_box(scaled.vertices)
    rotation, doubts = _find_up(scaled, given=up)
    warnings += doubts
    transform = np.eye(4)
    transform[:3, :3] = rotation * unit_guess.metres
    return _assemble(replace(scaled, vertices=scaled.vertices @ rotation.T), transform, tuple(warnings))


def _find_up(scaled: Geometry, *, given: str | None) -> tuple[Array, list[ShapeWarning]]:
    """The rotation `[3, 3]` to +Y up, and what is doubtful about it; an axis that the caller gives is obeyed."""
    warnings = []
    up = given or scaled.up
    if up is None:
        up_guess = choose_up(*_samples(scaled))
        up = up_guess.up
        if up_guess.doubt:
            warnings.append(ShapeWarning("OBJECT_UP_UNSURE", up_guess.doubt))
    rotation = up_rotation(up)
    tilt = _tilt(scaled, rotation, farthest=FARTHEST if given or scaled.up else math.pi)
    if tilt is None:
        return rotation, warnings
    turned = tilt.sure and given is None
    told = f"The object does not stand: it leans by {math.degrees(tilt.angle):.0f}°. "
    told += "It was set on its feet." if turned else "It was left so; set it on its feet if it should stand."
    leaning = ShapeWarning("OBJECT_TILTED", told)
    return (tilt.turn @ rotation, [leaning]) if turned else (rotation, [*warnings, leaning])


def _tilt(scaled: Geometry, rotation: Array, *, farthest: float) -> Tilt | None:
    """What is missing for a mesh to stand, once `rotation` `[3, 3]` is applied; None when it stands or is a cloud."""
    if scaled.faces is None:
        return None
    vertices = scaled.vertices @ rotation.T
    centre = surface_centre(vertices[scaled.faces])
    if stands(vertices, centre):
        return None
    points, normals = _samples(scaled)
    return find_tilt(vertices, points @ rotation.T, normals @ rotation.T, centre=centre, farthest=farthest)


def _samples(scaled: Geometry) -> tuple[Array, Array]:
    """Shuffled samples of the surface [m] and their normals of either sign, both `[N, 3]` in the file's axes."""
    samples, surface = sample_surface(scaled, choose_pitch(np.ptp(scaled.vertices, axis=0)))
    return samples.points, np.asarray(surface.normals if samples.normals is None else samples.normals, np.float64)


def _assemble(world: Geometry, transform: Array, warnings: tuple[ShapeWarning, ...]) -> Shape:
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
