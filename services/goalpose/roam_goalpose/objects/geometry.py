"""Raw geometry as a file holds it, before units and axes are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Geometry:
    """Triangles or bare points in file coordinates.

    Attributes:
        vertices: `[V, 3]` in the file's own unit and axes.
        faces: `[F, 3]` indices into `vertices`, or None for a point cloud.
        up: the up axis if the format fixes it (glTF: `y`), else None.
        unit: the unit if the format fixes it (glTF: `m`), else None. Files break this rule often enough that it is
            only a strong hint.
    """

    vertices: Array
    faces: Indices | None
    up: str | None = None
    unit: str | None = None

    @property
    def triangles(self) -> Array:
        """`[F, 3, 3]` corner positions; empty for a point cloud."""
        if self.faces is None:
            return np.zeros((0, 3, 3))
        return self.vertices[self.faces]
