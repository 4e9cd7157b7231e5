"""A file of several pieces of furniture: what stands apart is a piece, and one of them is posed on.

What touches is one piece, whatever nodes it is made of: a chair of six nodes is no set of six. Pieces are told apart by
the cells of a grid that their surfaces pass through, so thousands of screws cost no more than one body.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from roam_character.distance import turn_about_y
from scipy import ndimage

from roam_goalpose.objects.errors import ObjectError
from roam_goalpose.objects.geometry import Array, Geometry, Indices, triangle_areas
from roam_goalpose.objects.placing.heading import find_heading
from roam_goalpose.objects.placing.size import describe_shape, expected_size
from roam_goalpose.objects.placing.tilt import turn_to_y
from roam_goalpose.objects.surfaces.sampling import sample_triangles
from roam_goalpose.objects.surfaces.surface import surface_samples

_CELLS = 72  # along the longest side: 3 cm in a group of 2.2 m
_GAP = 1.5  # cells that must lie between pieces for them to be two: at one cell the turn of the upload would decide
_SAMPLES = 60_000
_AS_LARGE = 0.3  # of the largest piece's diagonal that a piece has at least
_BROAD = 0.25  # of its height that a piece is wide and deep at least: a leg is not
_LIFTED = 0.06  # of the height of all: how far above the floor a piece may begin
_ROOM = 1.5  # times the largest piece's diagonal: what is larger and no piece is the room
_MOST = 200


@dataclass(frozen=True, eq=False)
class Piece:
    """One of the things in a file.

    Attributes:
        name: of the node or group that most of it comes from; may be empty.
        geometry: its triangles, in file coordinates.
        strangeness: how unlike a seat or bed it is: small is like one.
    """

    name: str
    geometry: Geometry
    strangeness: float


def split(geometry: Geometry, *, up: Array) -> list[Piece]:
    """The pieces of a mesh, in the file's order; one, of everything, when nothing stands apart.

    Args:
        geometry: a mesh whose floor is cut off.
        up: `[3]` unit, in file coordinates.
    """
    if geometry.faces is None:
        return [_piece(geometry, up)]
    if not _groups(geometry, np.eye(3), 1.0).any():
        return [_piece(geometry, up)]
    # How near and how broad things are must not hang on how the upload is turned.
    axes = _own_axes(geometry, up)
    group = _groups(geometry, axes, _GAP)
    count = int(group.max()) + 1
    if count == 1 or count > _MOST:
        return [_piece(geometry, up)]
    boxes = _boxes(geometry, group, count, axes)
    whole = _standing_apart(boxes)
    nearest = _nearest(boxes, whole) if len(whole) else np.zeros(count, np.int64)
    if len(whole) < 2 and (nearest >= 0).all():
        return [_piece(geometry, up)]
    owner = nearest[group]
    return [_piece(geometry.only(owner == one), up) for one in whole]


def choose(pieces: Sequence[Piece], wanted: str | None) -> int:
    """Which piece to take: the one of that name or index, else the one most like a seat.

    Raises:
        ObjectError: OBJECT_PIECE_UNKNOWN.
    """
    if wanted is None:
        best = min(piece.strangeness for piece in pieces)
        return next(k for k, piece in enumerate(pieces) if piece.strangeness < best + 0.02)
    if wanted.strip().isdigit() and int(wanted) < len(pieces):
        return int(wanted)
    name = wanted.strip().lower()
    same = [k for k, piece in enumerate(pieces) if piece.name.lower() == name]
    alike = [k for k, piece in enumerate(pieces) if name and name in piece.name.lower()]
    if same:
        return same[0]
    if len(alike) == 1:
        return alike[0]
    raise ObjectError(
        "OBJECT_PIECE_UNKNOWN",
        field="piece",
        message=f"The file has no piece {wanted[:60]!r}; it has {list_pieces(pieces)}.",
        remedy="Give the index of a piece or its name, or leave it out for the best seat.",
    )


def list_pieces(pieces: Sequence[Piece]) -> str:
    """`0 (table), 1 (chair)` …, for sentences."""
    return ", ".join(f"{k} ({piece.name[:40] or 'no name'})" for k, piece in enumerate(pieces[:12]))


def _piece(geometry: Geometry, up: Array) -> Piece:
    name = ""
    if geometry.part is not None and geometry.names:
        names = Counter(geometry.names[k] for k in geometry.part[:: max(len(geometry.part) // 5000, 1)])
        name = names.most_common(1)[0][0]
    return Piece(name, geometry, _strangeness(geometry, up))


def _strangeness(geometry: Geometry, up: Array) -> float:
    """How unlike known furniture its shape is and, where the unit is declared, how far its size is from its shape's."""
    expected = expected_size(describe_shape(*surface_samples(geometry), turn_to_y(up)))
    if geometry.metres is None:
        return expected.deviation
    height = max(float(np.ptp(geometry.vertices @ up)) * geometry.metres, 1e-9)
    return expected.deviation + 0.5 * abs(float(np.log(height)) - expected.log_height)


def _own_axes(geometry: Geometry, up: Array) -> Array:
    """The rotation `[3, 3]` that brings the object to its own axes, Y up."""
    turn = turn_to_y(up)
    yaw = find_heading(geometry.vertices @ turn.T, geometry.faces).yaw
    own: Array = turn_about_y(yaw).T @ turn
    return own


def _groups(geometry: Geometry, axes: Array, size: float) -> Indices:
    """Which connected set of cells each triangle `[F]` lies in, numbered in the file's order.

    The cells lie along the rows of `axes` `[3, 3]` and are `size` times as large as `_CELLS` says.
    """
    assert geometry.faces is not None
    vertices = geometry.vertices @ axes.T
    low = vertices.min(axis=0)
    cell = size * max(float(np.ptp(vertices, axis=0).max()), 1e-12) / _CELLS
    grid = np.zeros([_CELLS + 4] * 3, dtype=bool)
    grid[_cells(surface_samples(geometry)[0] @ axes.T, low, cell)] = True
    grid[_cells(vertices, low, cell)] = True
    labels, count = ndimage.label(grid, structure=np.ones((3, 3, 3)))
    if count == 1:
        return np.zeros(len(geometry.faces), np.int64)
    triangles = vertices[geometry.faces]
    samples = sample_triangles(triangles, triangle_areas(triangles), _SAMPLES, seed=0).points
    inner = _cells(triangles.mean(axis=1), low, cell)
    grid[_cells(samples, low, cell)] = True
    grid[inner] = True
    labels, _ = ndimage.label(grid, structure=np.ones((3, 3, 3)))
    return _in_order(labels[inner])


def _cells(points: Array, low: Array, cell: float) -> tuple[npt.NDArray[np.int64], ...]:
    return tuple((np.floor((points - low) / cell).astype(np.int64) + 1).T)


def _in_order(labels: npt.NDArray[np.integer]) -> Indices:
    found, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(found), np.int64)
    rank[np.argsort(first)] = np.arange(len(found))
    return rank[inverse]


def _boxes(geometry: Geometry, group: Indices, count: int, axes: Array) -> Array:
    """Lowest and highest corner `[count, 2, 3]` of every group along the rows of `axes` `[3, 3]`, the second one up."""
    assert geometry.faces is not None
    turned = geometry.vertices @ axes.T
    corners = turned[geometry.faces]
    boxes = np.stack([np.full((count, 3), np.inf), np.full((count, 3), -np.inf)], axis=1)
    np.minimum.at(boxes[:, 0], group, corners.min(axis=1))
    np.maximum.at(boxes[:, 1], group, corners.max(axis=1))
    return boxes


def _standing_apart(boxes: Array) -> Indices:
    """Groups that are furniture of their own: large enough, broad enough, on the floor."""
    extents = boxes[:, 1] - boxes[:, 0]
    diagonal = np.linalg.norm(extents, axis=1)
    floor, height = boxes[:, 0, 1].min(), float(boxes[:, 1, 1].max() - boxes[:, 0, 1].min())
    broad = extents[:, ::2].min(axis=1) > _BROAD * extents[:, 1]
    solid = extents.min(axis=1) > 0.05 * diagonal
    grounded = boxes[:, 0, 1] < floor + _LIFTED * height
    fit = broad & solid & grounded
    return np.flatnonzero(fit & (diagonal > _AS_LARGE * diagonal[fit].max(initial=0.0)))


def _nearest(boxes: Array, whole: Indices) -> Indices:
    """For every group the piece whose box is nearest to its own; -1 for walls and the like, which belong to none."""
    gaps = np.maximum(boxes[None, whole, 0] - boxes[:, None, 1], boxes[:, None, 0] - boxes[None, whole, 1])
    apart = np.linalg.norm(np.maximum(gaps, 0.0), axis=2)
    owner: Indices = whole[np.argmin(apart, axis=1)]
    diagonal = np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
    owner[diagonal > _ROOM * diagonal[whole].max()] = -1
    owner[whole] = whole
    return owner
