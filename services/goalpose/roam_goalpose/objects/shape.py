"""An object as everything after the upload sees it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from roam_character.distance import DistanceGrid

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True)
class ShapeWarning:
    """Something the sender should know about how the file was understood.

    Attributes:
        reason: `OBJECT_UNIT_UNSURE`, `OBJECT_UP_UNSURE`, `OBJECT_TILTED`, …
        message: one sentence.
    """

    reason: str
    message: str


@dataclass(frozen=True)
class ShapePiece:
    """One of several things in a file.

    Attributes:
        name: of its node or group, may be empty.
        chosen: whether it is the one that the shape is of.
        bounds: lowest and highest corner (x, y, z, x, y, z) [m] in the shape's world.
    """

    name: str
    chosen: bool
    bounds: tuple[float, float, float, float, float, float]


@dataclass(frozen=True, eq=False)
class Shape:
    """An object in world coordinates: metres, +Y up, in the file's own placement (never recentred).

    Attributes:
        name: `objects/sha256:…` of the samples and the transform: equal for equal uploads.
        points: `[N, 3]` float32 surface samples [m], in an order whose every beginning is a fair sample.
        normals: `[N, 3]` float32 unit normals from the triangles' winding (either side), None for a point cloud.
        object_to_world: `[4, 4]` file coordinates → world: unit scale and axes.
        floor_height: lowest point [m].
        bounds: `[2, 3]` lowest and highest corner of the box [m].
        distance: signed distance to the object.
        front: `[3]` horizontal direction away from its back, as long as front and back differ: 1 for chairs, 0 for
            stools.
        mesh: (vertices `[V, 3]` float32 [m], faces `[F, 3]` int32) for display, None for a point cloud.
        warnings: doubts about unit, axes or size.
        pieces: what else the file holds, in its order; empty for a file of one piece.
    """

    name: str
    points: Floats
    normals: Floats | None
    object_to_world: npt.NDArray[np.float64]
    floor_height: float
    bounds: npt.NDArray[np.float64]
    distance: DistanceGrid
    front: npt.NDArray[np.float64]
    mesh: tuple[Floats, npt.NDArray[np.int32]] | None
    warnings: tuple[ShapeWarning, ...]
    pieces: tuple[ShapePiece, ...] = ()
