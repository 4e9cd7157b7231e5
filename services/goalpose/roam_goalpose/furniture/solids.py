"""Parametric solids: the bricks of procedural furniture.

Every solid answers two questions in its own local frame, in metres: how far is a point from my surface (negative
inside), and what does my surface look like as triangles. The sign is always exact, so occupancy is exact; the
magnitude is exact for `Box` and `Tube` and a usable approximation elsewhere.

    Solid
     ├── Box         box, optionally with rounded edges
     ├── Loft        sections stacked along y: legs, turned posts, seat plates, star-foot hubs
     ├── Pillow      super-ellipsoid: cushions, padding
     └── Tube        round tube along a polyline: rails, rungs, hoops
    more in sheets.py: Sheet, Wall, Prism
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Mesh = tuple[Array, NDArray[np.int64]]
"""Vertices `[V, 3]` [m] and triangles `[F, 3]`, wound so that normals point outwards."""


def grid_faces(rows: int, columns: int, *, wrap: bool = False) -> NDArray[np.int64]:
    """Triangles of a grid of `rows * columns` vertices; `wrap` joins the last column to the first."""
    r, c = np.meshgrid(np.arange(rows - 1), np.arange(columns if wrap else columns - 1), indexing="ij")
    a, b = r * columns + c, r * columns + (c + 1) % columns
    first = np.stack([a, b, a + columns], -1)
    second = np.stack([b, b + columns, a + columns], -1)
    return np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])


def join_meshes(meshes: list[Mesh]) -> Mesh:
    """Concatenates meshes into one."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    vertices = np.concatenate([vertices for vertices, _ in meshes])
    return vertices, np.concatenate([faces + start for (_, faces), start in zip(meshes, starts, strict=False)])


def fan(ring: Array) -> Mesh:
    """Closes a planar ring `[N, 3]` with triangles to its mean."""
    n = len(ring)
    index = np.arange(n)
    return np.concatenate([ring, ring.mean(0, keepdims=True)]), np.stack([index, (index + 1) % n, np.full(n, n)], -1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """A closed shape placed in the furniture's frame (+Y up, +Z front, metres)."""

    center: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.eye(3))
    """`[3, 3]`, local → furniture."""

    def local_distance(self, p: Array) -> Array:
        """Signed distance [m] of local points `[N, 3]`, negative inside."""
        raise NotImplementedError

    def local_mesh(self) -> Mesh:
        """Surface in the local frame; winding does not matter."""
        raise NotImplementedError

    def distance(self, points: Array) -> Array:
        """Signed distance `[N]` [m] of points `[N, 3]`, negative inside."""
        return self.local_distance((points - self.center) @ self.rotation)

    @cached_property
    def mesh(self) -> Mesh:
        """Surface in the furniture's frame, wound outwards (found by asking the distance on both sides)."""
        vertices, faces = self.local_mesh()
        corners = vertices[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
        keep = lengths[:, 0] > 1e-12
        step = 1e-3 * normals / np.maximum(lengths, 1e-12)
        middle = corners.mean(1)
        inwards = self.local_distance(middle + step) < self.local_distance(middle - step)
        faces = np.where(inwards[:, None], faces[:, ::-1], faces)[keep]
        return vertices @ self.rotation.T + self.center, faces

    @cached_property
    def bounds(self) -> Array:
        """`[2, 3]` axis-aligned bounds [m] of the surface."""
        return np.stack([self.mesh[0].min(0), self.mesh[0].max(0)])


@dataclass(frozen=True, kw_only=True, eq=False)
class Box(Solid):
    """A box with half sizes `half` [m] and edges rounded with `radius` [m]."""

    half: Array
    radius: float = 0.0

    def local_distance(self, p: Array) -> Array:
        radius = min(self.radius, float(self.half.min()))
        outside = np.abs(p) - (self.half - radius)
        return np.linalg.norm(np.maximum(outside, 0.0), axis=-1) + np.minimum(outside.max(-1), 0.0) - radius

    def local_mesh(self) -> Mesh:
        radius = min(self.radius, float(self.half.min()))
        rounded = np.array([-1.0, -0.5, 0.0, 0.0, 0.5, 1.0])
        line = rounded if radius > 0 else np.array([-1.0, 1.0])
        sign = np.repeat([-1.0, 1.0], len(line) // 2)
        a, b = np.meshgrid(np.arange(len(line)), np.arange(len(line)), indexing="ij")
        meshes: list[Mesh] = []
        for axis in range(3):
            for side in (-1.0, 1.0):
                direction, signs = np.full((*a.shape, 3), side), np.full((*a.shape, 3), side)
                direction[..., axis - 2], direction[..., axis - 1] = line[a], line[b]
                signs[..., axis - 2], signs[..., axis - 1] = sign[a], sign[b]
                direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
                vertices = signs * (self.half - radius) + radius * direction
                meshes.append((vertices.reshape(-1, 3), grid_faces(len(line), len(line))))
        return join_meshes(meshes)


@dataclass(frozen=True, kw_only=True, eq=False)
class Loft(Solid):
    """Sections stacked along local y, joined linearly: tapered, tilted, bent and turned posts, plates and hubs.

    A section is `|x/hx|^power + |z/hz|^power <= 1`: 2 an ellipse, 4-8 a rounded rectangle, 40 practically a rectangle.
    """

    heights: Array
    """`[S]` rising [m]."""
    half: Array
    """`[S, 2]` half sizes in x and z [m]."""
    shift: Array | None = None
    """`[S, 2]` middle of each section in x and z [m]; none is straight."""
    power: float = 40.0

    def _sections(self, y: Array) -> tuple[Array, Array]:
        shift = np.zeros_like(self.half) if self.shift is None else self.shift
        half = np.stack([np.interp(y, self.heights, self.half[:, k]) for k in range(2)], -1)
        return half, np.stack([np.interp(y, self.heights, shift[:, k]) for k in range(2)], -1)

    def local_distance(self, p: Array) -> Array:
        half, shift = self._sections(p[:, 1])
        relative = np.abs(p[:, ::2] - shift)
        ratio = relative / half
        norm = np.power(np.power(ratio, self.power).sum(-1), 1 / self.power) if self.power < 20 else ratio.max(-1)
        side = np.where(norm > 0.5, np.linalg.norm(relative, axis=-1) * (1 - 1 / np.maximum(norm, 1e-6)), -half.min(-1))
        if self.power >= 20:
            side = (relative - half).max(-1)
        slab = np.maximum(self.heights[0] - p[:, 1], p[:, 1] - self.heights[-1])
        return _intersect(side, slab)

    def local_mesh(self) -> Mesh:
        count = 4 if self.power >= 20 else 20
        angle = (np.arange(count) + 0.5) * 2 * np.pi / count
        circle = np.stack([np.cos(angle), np.sin(angle)], -1)
        p = 2.0 if self.power >= 20 else self.power
        circle /= np.power(np.power(np.abs(circle), p).sum(-1, keepdims=True), 1 / p)
        if self.power >= 20:
            circle *= np.sqrt(2.0)
        shift = np.zeros_like(self.half) if self.shift is None else self.shift
        rings = np.empty((len(self.heights), count, 3))
        rings[..., 1] = self.heights[:, None]
        rings[..., ::2] = self.half[:, None] * circle + shift[:, None]
        side = rings.reshape(-1, 3), grid_faces(len(rings), count, wrap=True)
        return join_meshes([side, fan(rings[0]), fan(rings[-1])])


@dataclass(frozen=True, kw_only=True, eq=False)
class Pillow(Solid):
    """A super-ellipsoid with half sizes `half` [m]: `plan` shapes its outline in xz, `profile` its edge in y."""

    half: Array
    plan: float = 4.0
    profile: float = 2.5

    def _norm(self, p: Array) -> Array:
        x, y, z = np.abs(p / self.half).T
        flat = np.power(np.power(x, self.plan) + np.power(z, self.plan), self.profile / self.plan)
        return np.asarray(np.power(flat + np.power(y, self.profile), 1 / self.profile))

    def local_distance(self, p: Array) -> Array:
        norm = self._norm(p)
        radial = np.linalg.norm(p, axis=-1) * (1 - 1 / np.maximum(norm, 1e-6))
        return np.where(norm < 0.5, (norm - 1) * self.half.min(), np.maximum(radial, -self.half.min()))

    def local_mesh(self) -> Mesh:
        rise, turn = np.linspace(-np.pi / 2, np.pi / 2, 13), np.arange(28) * 2 * np.pi / 28
        a, b = np.meshgrid(rise, turn, indexing="ij")
        direction = np.stack([np.cos(a) * np.cos(b), np.sin(a), np.cos(a) * np.sin(b)], -1).reshape(-1, 3) * self.half
        return direction / self._norm(direction)[:, None], grid_faces(13, 28, wrap=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tube(Solid):
    """A round tube of `radius` [m] along the polyline `path` `[P, 3]`; first = last point closes a hoop."""

    path: Array
    radius: float

    def local_distance(self, p: Array) -> Array:
        best = np.full(len(p), np.inf)
        for start, end in zip(self.path[:-1], self.path[1:], strict=True):
            axis = end - start
            along = np.clip((p - start) @ axis / max(float(axis @ axis), 1e-12), 0.0, 1.0)
            np.minimum(best, np.linalg.norm(p - start - along[:, None] * axis, axis=-1), out=best)
        return best - self.radius

    def local_mesh(self) -> Mesh:
        return join_meshes(
            [_capsule_mesh(a, b, self.radius) for a, b in zip(self.path[:-1], self.path[1:], strict=True)]
        )


def _capsule_mesh(start: Array, end: Array, radius: float) -> Mesh:
    """A capsule between two points; neighbours of a path overlap in their round ends."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    y = axis / max(length, 1e-9)
    x = np.cross(y, [1.0, 0.0, 0.0] if abs(y[0]) < 0.9 else [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    z = np.cross(x, y)
    rise = np.concatenate([np.linspace(-np.pi / 2, 0, 4), np.linspace(0, np.pi / 2, 4)])
    turn = np.arange(12) * 2 * np.pi / 12
    a, b = np.meshgrid(rise, turn, indexing="ij")
    along = np.sin(a) * radius + np.repeat([0.0, length], 4)[:, None]
    ring = radius * np.cos(a)
    vertices = start + along[..., None] * y + (ring * np.cos(b))[..., None] * x + (ring * np.sin(b))[..., None] * z
    return vertices.reshape(-1, 3), grid_faces(8, 12, wrap=True)


def _intersect(a: Array, b: Array) -> Array:
    """Signed distance of the intersection of two distances that act in perpendicular directions."""
    outside = np.hypot(np.maximum(a, 0.0), np.maximum(b, 0.0))
    return np.where((a > 0) | (b > 0), outside, np.maximum(a, b))


def turn_x(angle: float) -> Array:
    """Rotation matrix about +X [rad]: positive tips the top towards the front (+Z)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def turn_y(angle: float) -> Array:
    """Rotation matrix about +Y [rad]: positive turns the front (+Z) towards +X."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def turn_z(angle: float) -> Array:
    """Rotation matrix about +Z [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def vector(*values: float) -> Array:
    """A small float64 array."""
    return np.array(values, dtype=np.float64)


def points(values: ArrayLike) -> Array:
    """A float64 array `[N, K]` of points."""
    return np.asarray(values, dtype=np.float64)
