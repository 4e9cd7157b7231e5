"""Raw geometry as a file holds it, before units and axes are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from roam_goalpose.objects.arrays import Array, Indices
from roam_goalpose.objects.shape import ShapeWarning

__all__ = ["Array", "Geometry", "Indices", "Part", "join"]


@dataclass(frozen=True, eq=False)
class Geometry:
    """Triangles or bare points in file coordinates.

    Attributes:
        vertices: `[V, 3]` in the file's own unit and axes.
        faces: `[F, 3]` indices into `vertices`, or None for a point cloud.
        up: the up axis if the file says it (glTF: always `y`), else None.
        metres: length of one file unit [m] if the file says it (glTF: always 1), else None.
        part: `[F]` which of `names` each triangle belongs to; None when the file has no parts, or is a cloud.
        names: what the file calls its parts (nodes, groups, objects); they may repeat.
        notes: what the reader left out or could not be sure of.
    """

    vertices: Array
    faces: Indices | None
    up: str | None = None
    metres: float | None = None
    part: Indices | None = None
    names: tuple[str, ...] = ()
    notes: tuple[ShapeWarning, ...] = ()

    @cached_property
    def triangles(self) -> Array:
        """`[F, 3, 3]` corner positions; empty for a point cloud."""
        if self.faces is None:
            return np.zeros((0, 3, 3))
        return self.vertices[self.faces]

    @cached_property
    def areas(self) -> Array:
        """`[F]` of the triangles."""
        return triangle_areas(self.triangles)

    def noted(self, reason: str, message: str) -> Geometry:
        """The same with one more note."""
        return replace(self, notes=(*self.notes, ShapeWarning(reason, message)))

    def only(self, faces: npt.NDArray[np.bool_]) -> Geometry:
        """The triangles of a mask `[F]` and the vertices that they use."""
        assert self.faces is not None
        used = np.zeros(len(self.vertices), dtype=bool)
        chosen = self.faces[faces]
        used[chosen] = True
        renumber = np.cumsum(used) - 1
        part = None if self.part is None else self.part[faces]
        return replace(self, vertices=self.vertices[used], faces=renumber[chosen], part=part)


@dataclass(frozen=True, eq=False)
class Part:
    """One node, group or object of a file, placed in the file's coordinates.

    Attributes:
        name: as the file has it, may be empty.
        vertices: `[V, 3]`.
        faces: `[F, 3]` into `vertices`; None for loose points.
    """

    name: str
    vertices: Array
    faces: Indices | None


def join(parts: Sequence[Part]) -> Geometry:
    """All parts as one geometry; loose points count only where no part has a face."""
    meshes = [part for part in parts if part.faces is not None and len(part.faces)]
    if not meshes:
        points = [part.vertices for part in parts]
        return Geometry(np.concatenate(points) if points else np.zeros((0, 3)), None)
    starts = np.cumsum([0, *(len(part.vertices) for part in meshes[:-1])])
    faces = [start + np.asarray(part.faces, np.int64) for start, part in zip(starts, meshes, strict=True)]
    return Geometry(
        np.concatenate([part.vertices for part in meshes]),
        np.concatenate(faces),
        part=np.repeat(np.arange(len(meshes)), [len(one) for one in faces]),
        names=tuple(part.name for part in meshes),
    )


def triangle_areas(triangles: Array) -> Array:
    """Areas `[F]` of triangles `[F, 3, 3]`."""
    vectors = area_vectors(triangles)
    return 0.5 * np.sqrt(np.einsum("fi,fi->f", vectors, vectors))


def area_vectors(triangles: Array) -> Array:
    a, b = (triangles[:, k] - triangles[:, 0] for k in (1, 2))
    x = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    y = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    return np.stack([x, y, a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]], axis=1)  # np.cross takes twice as long
