"""Solids made from a profile in the side view (z, y): bent plates, prisms, and round walls about a vertical axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roam_goalpose.furniture.solids import Array, Mesh, Solid, _intersect, fan, grid_faces, join_meshes


def smooth_curve(control: Array, *, count: int = 16) -> Array:
    """Catmull-Rom curve `[count, D]` through control points `[K, D]`."""
    padded = np.concatenate([2 * control[:1] - control[1:2], control, 2 * control[-1:] - control[-2:-1]])
    position = np.linspace(0, len(control) - 1 - 1e-9, count)
    index = position.astype(int)
    t = (position - index)[:, None]
    a, b, c, d = (padded[index + k] for k in range(4))
    return np.asarray(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3))


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet(Solid):
    """A plate of `thickness` [m] that follows `profile` `[S, 2]` (z, y) in the side view: shells, bent backs, slings.

    The plate reaches `half_width[s]` to both sides and lifts off along the profile's left normal by
    `bend[s] * |x / half_width|^bend_power` [m], which makes buckets, wrapped backs and dished seats.
    """

    profile: Array
    thickness: float
    half_width: Array
    bend: Array | None = None
    bend_power: float = 2.0

    def _bend(self) -> Array:
        return np.zeros(len(self.profile)) if self.bend is None else self.bend

    def local_distance(self, p: Array) -> Array:
        flat, best = p[:, [2, 1]], np.full(len(p), np.inf)
        offset, half, lift = np.zeros(len(p)), np.ones(len(p)), np.zeros(len(p))
        bend = self._bend()
        for i in range(len(self.profile) - 1):
            start, axis = self.profile[i], self.profile[i + 1] - self.profile[i]
            along = np.clip((flat - start) @ axis / (axis @ axis), 0.0, 1.0)
            rest = flat - start - along[:, None] * axis
            distance = np.hypot(rest[:, 0], rest[:, 1])
            side = np.sign(axis[0] * rest[:, 1] - axis[1] * rest[:, 0])
            closer = distance < best
            best = np.where(closer, distance, best)
            offset = np.where(closer, distance * np.where(side == 0, 1.0, side), offset)
            half = np.where(closer, self.half_width[i] * (1 - along) + self.half_width[i + 1] * along, half)
            lift = np.where(closer, bend[i] * (1 - along) + bend[i + 1] * along, lift)
        lifted = lift * np.power(np.minimum(np.abs(p[:, 0]) / half, 1.2), self.bend_power)
        slope = 1 + np.abs(lift) * self.bend_power / half
        return _intersect((np.abs(offset - lifted) - self.thickness / 2) / np.sqrt(slope), np.abs(p[:, 0]) - half)

    def _normals(self) -> Array:
        tangent = np.gradient(self.profile, axis=0)
        tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
        return np.stack([-tangent[:, 1], tangent[:, 0]], -1)

    def _loop(self) -> tuple[Array, Array, Array, Array]:
        """Outline of the plate in the side view: point, offset direction, half width and bend per loop vertex."""
        normal, profile, bend = self._normals(), self.profile, self._bend()
        angle = np.linspace(0, np.pi, 5)[1:-1]
        tangent = np.stack([normal[:, 1], -normal[:, 0]], -1)
        tail = [np.cos(a) * normal[-1] + np.sin(a) * tangent[-1] for a in angle]
        head = [-np.cos(a) * normal[0] - np.sin(a) * tangent[0] for a in angle]
        index = np.concatenate([np.arange(len(profile)), [-1] * 3, np.arange(len(profile))[::-1], [0] * 3])
        directions = np.concatenate([normal, tail, -normal[::-1], head])
        return profile[index] + directions * self.thickness / 2, normal[index], self.half_width[index], bend[index]

    def local_mesh(self) -> Mesh:
        flat, normal, half, bend = self._loop()
        across = np.linspace(-1, 1, 11)
        lifted = flat[:, None] + normal[:, None] * (bend[:, None] * np.abs(across) ** self.bend_power)[..., None]
        vertices = np.empty((11, len(flat), 3))
        vertices[..., 0] = (half[:, None] * across).T
        vertices[..., 1], vertices[..., 2] = lifted[..., 1].T, lifted[..., 0].T
        tube = vertices.reshape(-1, 3), grid_faces(11, len(flat), wrap=True)
        return join_meshes([tube, self._cap(vertices[0]), self._cap(vertices[-1])])

    def _cap(self, ring: Array) -> Mesh:
        """Closes one side: the strip between the two offset lines, and a fan over each round end."""
        n = len(self.profile)
        strip = np.stack([ring[:n], ring[n + 3 : 2 * n + 3][::-1]])
        meshes = [(strip.reshape(-1, 3), grid_faces(2, n))]
        meshes.append(fan(ring[n - 1 : n + 4]))
        meshes.append(fan(np.concatenate([ring[2 * n + 2 :], ring[:1]])))
        return join_meshes(meshes)


@dataclass(frozen=True, kw_only=True, eq=False)
class Prism(Solid):
    """A polygon `outline` `[N, 2]` (z, y) in the side view, extruded to `half_width` [m] on both sides."""

    outline: Array
    half_width: float

    def local_distance(self, p: Array) -> Array:
        flat, best = p[:, [2, 1]], np.full(len(p), np.inf)
        inside = np.zeros(len(p), dtype=bool)
        for a, b in zip(self.outline, np.roll(self.outline, -1, axis=0), strict=True):
            axis = b - a
            along = np.clip((flat - a) @ axis / max(float(axis @ axis), 1e-12), 0.0, 1.0)
            np.minimum(best, np.linalg.norm(flat - a - along[:, None] * axis, axis=-1), out=best)
            crosses = (a[1] > flat[:, 1]) != (b[1] > flat[:, 1])
            with np.errstate(divide="ignore", invalid="ignore"):
                left = flat[:, 0] < axis[0] * (flat[:, 1] - a[1]) / axis[1] + a[0]
            inside ^= crosses & left
        return _intersect(np.where(inside, -best, best), np.abs(p[:, 0]) - self.half_width)

    def local_mesh(self) -> Mesh:
        rings = np.empty((2, len(self.outline), 3))
        rings[..., 0] = self.half_width * np.array([[-1.0], [1.0]])
        rings[..., 2], rings[..., 1] = self.outline[:, 0], self.outline[:, 1]
        triangles = _ear_clip(self.outline)
        caps: list[Mesh] = [(ring, triangles) for ring in rings]
        return join_meshes([(rings.reshape(-1, 3), grid_faces(2, len(self.outline), wrap=True)), *caps])


def _ear_clip(outline: Array) -> np.ndarray:
    """Triangles `[N - 2, 3]` of a simple polygon by cutting ears."""
    turn = float(np.sum(outline[:, 0] * np.roll(outline[:, 1], -1) - np.roll(outline[:, 0], -1) * outline[:, 1]))
    left = list(range(len(outline))) if turn > 0 else list(range(len(outline)))[::-1]
    triangles: list[tuple[int, int, int]] = []
    while len(left) > 3:
        ear = next((k for k in range(len(left)) if _is_ear(outline, left, k)), 0)
        triangles.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return np.array([*triangles, tuple(left)], dtype=np.int64)


def _is_ear(outline: Array, left: list[int], k: int) -> bool:
    a, b, c = (outline[left[j % len(left)]] for j in (k - 1, k, k + 1))

    def side(p: Array, q: Array, r: Array) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    if side(a, b, c) <= 0:
        return False
    others = [outline[j] for m, j in enumerate(left) if m not in {(k - 1) % len(left), k, (k + 1) % len(left)}]
    return not any(min(side(a, b, q), side(b, c, q), side(c, a, q)) >= 0 for q in others)


@dataclass(frozen=True, kw_only=True, eq=False)
class Wall(Solid):
    """A round wall about the local y axis, open to the front: barrel backs, tub chairs, curved rails.

    The ellipse of half axes `radius` (x, z) [m] is followed over `±sweep` [rad] from the back (−Z); the top falls from
    `top[0]` at the back to `top[1]` at the open ends, and the wall leans outwards by `lean` [m per m of height].
    """

    radius: Array
    thickness: float
    sweep: float
    bottom: float
    top: Array
    lean: float = 0.0
    fall: float = 1.0

    def _top(self, angle: Array) -> Array:
        blend = np.power(np.clip(np.abs(angle) / self.sweep, 0.0, 1.0), self.fall)
        return np.asarray(self.top[0] + (self.top[1] - self.top[0]) * (3 - 2 * blend) * blend**2)

    def local_distance(self, p: Array) -> Array:
        grown = self.radius + self.lean * (p[:, 1:2] - self.bottom)
        scaled = p[:, ::2] / np.maximum(grown, 1e-3)
        ring = np.linalg.norm(scaled, axis=-1)
        angle = np.arctan2(scaled[:, 0], -scaled[:, 1])
        local_radius = np.linalg.norm(p[:, ::2], axis=-1) / np.maximum(ring, 1e-6)
        across = np.abs(ring - 1) * local_radius - self.thickness / 2
        beyond = (np.abs(angle) - self.sweep) * np.linalg.norm(p[:, ::2], axis=-1)
        slab = np.maximum(self.bottom - p[:, 1], p[:, 1] - self._top(angle))
        return _intersect(_intersect(across, beyond), slab)

    def local_mesh(self) -> Mesh:
        angle = np.linspace(-self.sweep, self.sweep, 25)
        direction = np.stack([np.sin(angle), -np.cos(angle)], -1)
        rings = np.empty((25, 4, 3))
        for k, (high, side) in enumerate([(0, -1), (1, -1), (1, 1), (0, 1)]):
            height = self._top(angle) if high else np.full(25, self.bottom)
            axes = self.radius + self.lean * (height - self.bottom)[:, None]
            line = direction * axes
            line *= 1 + side * self.thickness / 2 / np.linalg.norm(line, axis=-1, keepdims=True)
            rings[:, k, ::2], rings[:, k, 1] = line, height
        return join_meshes([(rings.reshape(-1, 3), grid_faces(25, 4, wrap=True)), fan(rings[0]), fan(rings[-1])])
