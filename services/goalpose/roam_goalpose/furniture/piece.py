"""A piece of furniture: a union of solids with exact occupancy, plus where one sits on it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import trimesh
from numpy.typing import NDArray

from roam_goalpose.furniture.solids import Array, Mesh, Solid, join_meshes


@dataclass(frozen=True, eq=False)
class Furniture:
    """Solids in the canonical frame: +Y up, seat facing +Z, standing on y = 0, metres."""

    category: str
    solids: tuple[Solid, ...]
    seats: Array
    """`[K, 3]` points on top of the seat where hips go, left to right."""
    lie_axis: Array | None = None
    """`[2, 3]` where feet and head of a lying person go, on top of the lying surface; none if too short."""
    front_yaw: float = 0.0
    """Heading of a seated person [rad]; 0 faces +Z."""

    @property
    def seat_height(self) -> float:
        """Height of the seat's top above the floor [m]."""
        return float(self.seats[:, 1].mean())

    @cached_property
    def mesh(self) -> Mesh:
        """All solids' triangles, concatenated: vertices `[V, 3]` [m], faces `[F, 3]`."""
        return join_meshes([solid.mesh for solid in self.solids])

    @property
    def bounds(self) -> Array:
        """`[2, 3]` axis-aligned bounds [m]."""
        boxes = np.stack([solid.bounds for solid in self.solids])
        return np.stack([boxes[:, 0].min(0), boxes[:, 1].max(0)])

    def distance(self, points: Array) -> Array:
        """Signed distance `[N]` [m] of points `[N, 3]`: exact sign, approximate magnitude."""
        return np.min([solid.distance(points) for solid in self.solids], axis=0)

    def occupancy(self, points: Array) -> NDArray[np.bool_]:
        """Whether each of the points `[N, 3]` lies inside a solid; exact."""
        inside = np.zeros(len(points), dtype=bool)
        for solid in self.solids:
            low, high = solid.bounds + np.array([[-0.02], [0.02]])
            near = np.flatnonzero(~inside & ((points >= low) & (points <= high)).all(-1))
            inside[near] = solid.distance(points[near]) < 0
        return inside

    def sample_surface(self, count: int, *, seed: int, hidden: bool = False) -> tuple[Array, Array]:
        """`count` points and outward normals `[count, 3]`, uniform by area.

        Points buried in other solids are rejected unless `hidden`, which is what scanning every sub-mesh would give.
        """
        random = np.random.default_rng(seed)
        pieces: list[tuple[Array, Array]] = []
        found = 0
        while found < count:
            points, normals = self._draw(2 * count, random)
            keep = np.ones(len(points), dtype=bool) if hidden else ~self.occupancy(points + 1e-3 * normals)
            pieces.append((points[keep], normals[keep]))
            found += int(keep.sum())
        points, normals = (np.concatenate(parts)[:count] for parts in zip(*pieces, strict=True))
        return points, normals

    def _draw(self, count: int, random: np.random.Generator) -> tuple[Array, Array]:
        vertices, faces = self.mesh
        corners = vertices[faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(cross, axis=-1)
        chosen = random.choice(len(faces), count, p=area / area.sum())
        u, v = np.sqrt(random.random((count, 1))), random.random((count, 1))
        a, b, c = corners[chosen].transpose(1, 0, 2)
        return (1 - u) * a + u * (1 - v) * b + u * v * c, cross[chosen] / area[chosen, None]

    def standing(self) -> Furniture:
        """Moved so that it stands on y = 0 with its box centred in x and z."""
        low, high = self.bounds
        offset = -np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        solids = tuple(replace(solid, center=solid.center + offset) for solid in self.solids)
        lie = None if self.lie_axis is None else self.lie_axis + offset
        return replace(self, solids=solids, seats=self.seats + offset, lie_axis=lie)

    def to_trimesh(self) -> trimesh.Trimesh:
        """The mesh for export, with equal vertices merged."""
        vertices, faces = self.mesh
        return trimesh.Trimesh(vertices, faces, process=True)
