"""Inside/outside labels for meshes that are open, thin or self-intersecting.

Ray parity and winding numbers need closed surfaces, which three quarters of free meshes are not. A point counts as
inside if it is within a few millimetres of the surface (thin plates are solid), or if air poured in from outside
cannot reach it: voxels near the surface are a barrier, dilated by one voxel so that small gaps close, and the floor is
a barrier too, because many sofas have no underside.

Those that stand on feet besides are open a hand's breadth over the floor, and chests and bed frames have slits: what is
walled in on four sides and above and reaches down near the floor counts as body here as it does in the distance grid
that the solver keeps bodies out of (`objects/voxels.py`). A board, a shell or a frame has no inside but its skin.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from roam_goalpose.objects.surfaces.voxels import walled_in

Array = NDArray[np.float64]

SKIN = 0.005
"""Half thickness [m] that every surface is given."""
MARGIN = 3
"""Free voxels kept around the object, so that the outside is connected."""


@dataclass(frozen=True, eq=False)
class MeshLabels:
    """Distance and inside test of one mesh in its canonical frame (standing on y = 0, metres)."""

    samples: Array
    """`[M, 3]` dense points on the surface."""
    normals: Array
    """`[M, 3]` unit, from the winding of the triangles (not made consistent)."""
    inside: NDArray[np.bool_]
    """`[X, Y, Z]` voxels that the air from outside cannot reach."""
    origin: Array
    pitch: float

    @cached_property
    def tree(self) -> cKDTree:
        return cKDTree(self.samples)

    def distance(self, points: Array) -> Array:
        """Signed distance `[N]` [m] of points `[N, 3]` to the thickened surface, negative inside."""
        distance, nearest = self.tree.query(points)
        away = (points - self.samples[nearest]) / np.maximum(distance, 1e-9)[:, None]
        # A voxel that holds surface has no side of its own: look a voxel further away from the surface.
        enclosed = self._lookup(points + away * 1.5 * self.pitch) & (distance > 1e-6)
        return np.where(enclosed, -distance - SKIN, distance - SKIN)

    def _lookup(self, points: Array) -> NDArray[np.bool_]:
        index = np.floor((points - self.origin) / self.pitch).astype(int)
        valid = ((index >= 0) & (index < self.inside.shape)).all(-1)
        index = np.clip(index, 0, np.array(self.inside.shape) - 1)
        return np.asarray(self.inside[tuple(index.T)] & valid)


def label_mesh(mesh: trimesh.Trimesh, *, seed: int = 0, pitch: float | None = None) -> MeshLabels:
    """Prepares the inside test of a mesh; `pitch` [m] is the voxel size (default: 8-14 mm by object size)."""
    low, high = np.asarray(mesh.bounds)
    step = float(np.clip((high - low).max() / 200, 0.008, 0.014)) if pitch is None else pitch
    wanted = int(np.clip(3.0 * mesh.area / step**2, 60_000, 400_000))
    drawn, faces = trimesh.sample.sample_surface(mesh, wanted, seed=seed)
    samples, normals = np.asarray(drawn, dtype=np.float64), np.asarray(mesh.face_normals[faces], dtype=np.float64)
    origin = low - MARGIN * step
    surface = np.zeros(tuple(np.ceil((high - low) / step).astype(int) + 2 * MARGIN), dtype=bool)
    # Twelve points per voxel leave six in a million empty; with two or three the air finds a way through a large bed.
    for part in range(int(np.ceil(12.0 * mesh.area / step**2 / wanted))):
        points = samples if part == 0 else trimesh.sample.sample_surface(mesh, wanted, seed=seed + part)[0]
        surface[tuple(np.floor((points - origin) / step).astype(int).T)] = True
    return MeshLabels(samples, normals, _enclosed(surface, floor=MARGIN, pitch=step), origin, step)


def _enclosed(surface: NDArray[np.bool_], *, floor: int, pitch: float) -> NDArray[np.bool_]:
    """Voxels that cannot be reached from outside without crossing the surface, the floor or a hollow of the body.

    `floor` is the number of layers below the floor, `pitch` the size of a voxel [m].
    """
    barrier = ndimage.binary_dilation(surface)
    barrier[:, :floor] = True
    hollow = walled_in(~barrier, ndimage.binary_dilation(surface), level=floor - 1, pitch=pitch)
    regions, _ = ndimage.label(~barrier & ~hollow)
    outside = regions == regions[0, -1, 0]
    outside = ndimage.binary_dilation(outside, mask=~surface & ~hollow, iterations=1)
    outside[:, :floor] = True
    return ~outside & ~surface
