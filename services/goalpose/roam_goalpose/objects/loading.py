"""The way from uploaded bytes to a `Shape`, in one process. Servers use `isolation` around it."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from roam_character.distance import turn_about_y

from roam_goalpose.objects.cleaning.clean import Cleaned, clean
from roam_goalpose.objects.cleaning.pieces import Piece, choose, list_pieces, split
from roam_goalpose.objects.errors import ObjectError
from roam_goalpose.objects.geometry import Array, Geometry, Indices
from roam_goalpose.objects.limits import Limits
from roam_goalpose.objects.placing.axes import check_up, up_rotation
from roam_goalpose.objects.placing.heading import find_heading
from roam_goalpose.objects.placing.place import likely_up, place
from roam_goalpose.objects.placing.units import LARGEST, METRES_PER, check_size, check_unit, too_large
from roam_goalpose.objects.reading import read_geometry
from roam_goalpose.objects.shape import Shape, ShapePiece, ShapeWarning
from roam_goalpose.objects.surfaces.sampling import sample_triangles
from roam_goalpose.objects.surfaces.surface import sample_surface, surface_samples
from roam_goalpose.objects.surfaces.voxels import choose_pitch, signed_distance

_LEVEL = 0.999  # cosine of an axis that still is the floor's
_STANDS_ON = 0.08  # [m] at most between a floor that was cut off and what is left above it
_LARGE, _OUTLINE = 300_000, 100_000  # triangles from which on points stand for them, and how many
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
    floor = cleaned.floor
    pieces, chosen = _pieces(geometry, cleaned, unit=unit, up=up, size=size, wanted=piece)
    object = pieces[chosen].geometry
    placing = place(object, unit=unit, up=up, size=size, level=None if floor is None else floor.up)
    surface_samples.cache_clear()
    turn = placing.rotation * placing.metres
    world = replace(object, vertices=object.vertices @ turn.T)
    _check_box(world.vertices)
    areas = None if object.faces is None else object.areas * placing.metres**2
    outline = _outline(object, world, turn)
    transform = np.eye(4)
    transform[:3, :3] = turn
    level = None
    if floor is not None and float(placing.rotation[1] @ floor.up) > _LEVEL:
        level = floor.height * placing.metres
    warnings = [*cleaned.geometry.notes, *placing.warnings]
    if len(pieces) == 1:
        return _assemble(world, transform, tuple(warnings), level, areas, outline)
    if piece is None:
        told = f"The file holds {len(pieces)} pieces: {list_pieces(pieces)}. Piece {chosen} was taken."
        warnings.append(ShapeWarning("OBJECT_PIECE_CHOSEN", told))
    shape = _assemble(world, transform, tuple(warnings), level, areas, outline)
    return replace(shape, pieces=tuple(_told(one, k == chosen, turn) for k, one in enumerate(pieces)))


def _pieces(
    geometry: Geometry, cleaned: Cleaned, *, unit: str | None, up: str | None, size: float | None, wanted: str | None
) -> tuple[list[Piece], int]:
    """The pieces of a file and which one to take; a room is refused unless one is named."""
    left, floor = cleaned.geometry, cleaned.floor
    axis = up or geometry.up
    way = floor.up if floor is not None else up_rotation(axis or likely_up(left))[1]
    pieces = split(left, up=way)
    chosen = choose(pieces, wanted)
    metres = METRES_PER[unit] if unit else geometry.metres
    if size is None and wanted is None and metres is not None:
        extent = float(np.ptp(geometry.vertices, axis=0).max()) * metres
        if extent > LARGEST:
            raise too_large(extent, metres, list_pieces(pieces) if len(pieces) > 1 else "")
    return pieces, chosen


def _told(piece: Piece, chosen: bool, turn: npt.NDArray[np.float64]) -> ShapePiece:
    placed = piece.geometry.vertices @ turn.T
    low, high = placed.min(axis=0).tolist(), placed.max(axis=0).tolist()
    return ShapePiece(piece.name, chosen, (low[0], low[1], low[2], high[0], high[1], high[2]))


def _assemble(
    world: Geometry,
    transform: Array,
    warnings: tuple[ShapeWarning, ...],
    level: float | None,
    areas: Array | None,
    outline: tuple[Array, Indices | None],
) -> Shape:
    """Sample geometry in metres and +Y up, and build its distance grid, both in the object's own axes.

    An upload turned about +Y then has the same samples and the same grid, turned.
    """
    heading = find_heading(*outline)
    axes = turn_about_y(heading.yaw)
    own = world.vertices @ axes
    box = np.stack([own.min(axis=0), own.max(axis=0)])
    pitch = choose_pitch(box[1] - box[0])
    samples, surface = sample_surface(replace(world, vertices=own), pitch, areas)
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


def _outline(object: Geometry, world: Geometry, turn: npt.NDArray[np.float64]) -> tuple[Array, Indices | None]:
    """What the own axes are found from: the mesh or, of a large one, points spread over it in the order of its file."""
    if object.faces is None or len(object.faces) < _LARGE:
        return world.vertices, world.faces
    return sample_triangles(object.triangles, object.areas, _OUTLINE, seed=0).points @ turn.T, None


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
