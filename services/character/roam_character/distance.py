"""Signed distance to objects, anywhere in space: on one grid, or on a grid for every character.

`DistanceGrid` is one object for many points, differentiable by autograd too. `DistanceGrids` looks up points of a batch
each on its own object, in one go however many objects there are. Both interpolate trilinearly and agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import torch

_TINY = 1e-6  # [m]
_TRILINEAR = (0, 1, True)  # as `grid_sample` below


def turn_about_y(yaw: float) -> npt.NDArray[np.float64]:
    """The rotation matrix `[3, 3]` of a turn about +Y [rad]."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """Signed distance [m] to the object's surface, negative inside, interpolated between grid nodes.

    Outside the grid the value at the nearest point of the grid's box plus the distance to that point: an upper bound
    that still points the right way.

    Attributes:
        origin: `[3]` position of node (0, 0, 0) [m], in the grid's own axes.
        pitch: node spacing [m].
        values: `[X, Y, Z]` float32 [m].
        yaw: by which the grid's axes are turned about the world's +Y [rad].
    """

    origin: npt.NDArray[np.float64]
    pitch: float
    values: npt.NDArray[np.float32]
    yaw: float = 0.0

    def query(self, x: torch.Tensor) -> torch.Tensor:
        """Distance `[...]` [m] at world points `[..., 3]` [m]; differentiable in `x` (piecewise trilinear)."""
        unit, beyond = self._placed(x)
        return self._interpolated(unit) + _length(beyond)[..., 0]

    def tangent(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Distance `[...]` [m] and its gradient `[..., 3]` at world points `[..., 3]` [m], in closed form."""
        import torch

        unit, beyond = self._placed(x.detach())
        places, values = unit.reshape(1, 1, 1, -1, 3), self._tensors[0].to(unit)
        found = torch.ops.aten.grid_sampler_3d(values, places, *_TRILINEAR)
        _, slope = torch.ops.aten.grid_sampler_3d_backward(
            torch.ones_like(found), values, places, *_TRILINEAR, (False, True)
        )
        far_away = _length(beyond)
        slope = slope.reshape(unit.shape) * self._tensors[2].to(x)
        gradient = torch.where(beyond == 0, slope, 0.0) + beyond / (far_away + _TINY)
        return found.reshape(unit.shape[:-1]) + far_away[..., 0], self._world(gradient)

    def _placed(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """World points in the grid, from -1 to 1 along every axis, and how far beyond its box they lie [m]."""
        _, low, scale = (part.to(x) for part in self._tensors)
        local = self._local(x)
        inside = local.clamp(low, low + 2 / scale)
        return (inside - low) * scale - 1, local - inside

    def _interpolated(self, unit: torch.Tensor) -> torch.Tensor:
        """Values at places in the grid."""
        import torch  # here, so that the process that only parses uploads need not load it

        places, values = unit.reshape(1, 1, 1, -1, 3), self._tensors[0].to(unit)
        found = torch.nn.functional.grid_sample(values, places, padding_mode="border", align_corners=True)
        return found.reshape(unit.shape[:-1])

    def _local(self, x: torch.Tensor) -> torch.Tensor:
        """World points in the grid's own axes."""
        return x if self.yaw == 0 else x @ self._axes.to(x)

    def _world(self, direction: torch.Tensor) -> torch.Tensor:
        """Directions along the grid's axes in the world."""
        return direction if self.yaw == 0 else direction @ self._axes.to(direction).T

    def sample(self, points: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
        """`query` for numpy points `[..., 3]`, without gradients."""
        import torch

        with torch.no_grad():
            result: npt.NDArray[np.float32] = self.query(torch.as_tensor(points, dtype=torch.float32)).numpy()
        return result

    @cached_property
    def _axes(self) -> torch.Tensor:
        """The grid's axes in the world, as columns."""
        import torch

        return torch.tensor(turn_about_y(self.yaw))

    @cached_property
    def _tensors(self) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """The values as a volume `[1, 1, Z, Y, X]`; the lowest node `[3]` [m]; 2 / size of the box `[3]` [1/m]."""
        import torch

        size = (np.array(self.values.shape) - 1) * self.pitch
        volume = torch.tensor(self.values).permute(2, 1, 0)[None, None].contiguous()
        return volume, torch.tensor(self.origin, dtype=torch.float32), torch.tensor(2 / size, dtype=torch.float32)


@dataclass(frozen=True, eq=False)
class DistanceGrids:
    """The grids of B characters, one behind the other; grids that several share are kept once.

    Attributes:
        values: `[N]` [m] of all grids.
        start: `[B]` where each one's values begin.
        size: `[B, 3]` nodes along its axes.
        origin: `[B, 3]` position of its node (0, 0, 0) [m].
        pitch: `[B]` node spacing [m].
        axes: `[B, 3, 3]`; row vectors of the grid times this are in the world.
    """

    values: torch.Tensor
    start: torch.Tensor
    size: torch.Tensor
    origin: torch.Tensor
    pitch: torch.Tensor
    axes: torch.Tensor

    @classmethod
    def of(cls, grids: Sequence[DistanceGrid]) -> DistanceGrids:
        """From the grid of every character, its origin in the grid's own axes."""
        import torch

        distinct = {id(grid): grid for grid in grids}
        starts, count = {}, 0
        for key, grid in distinct.items():
            starts[key] = count
            count += grid.values.size
        axes = [turn_about_y(grid.yaw).T for grid in grids]
        return cls(
            values=torch.from_numpy(np.concatenate([grid.values.ravel() for grid in distinct.values()])).float(),
            start=torch.tensor([starts[id(grid)] for grid in grids]),
            size=torch.tensor([grid.values.shape for grid in grids]),
            origin=torch.tensor(
                np.stack([grid.origin @ turn for grid, turn in zip(grids, axes, strict=True)]), dtype=torch.float32
            ),
            pitch=torch.tensor([grid.pitch for grid in grids], dtype=torch.float32),
            axes=torch.tensor(np.stack(axes), dtype=torch.float32),
        )

    def of_rows(self, rows: torch.Tensor) -> DistanceGrids:
        """Those of some of the characters."""
        parts = (self.start, self.size, self.origin, self.pitch, self.axes)
        return DistanceGrids(self.values, *(part[rows] for part in parts))

    def tangent(self, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Distance `[B, P]` [m] and its gradient `[B, P, 3]` at world points `[B, P, 3]` [m]."""
        import torch

        pitch = self.pitch[:, None, None]
        local = (points - self.origin[:, None]) @ self.axes.transpose(-1, -2) / pitch
        last = (self.size - 1)[:, None].to(local)
        inside = torch.minimum(local.clamp_min(0.0), last)
        cell = torch.minimum(inside.floor(), last - 1)
        u, v, w = (inside - cell).unbind(-1)
        rows, layers = self.size[:, 2:], self.size[:, 1:2] * self.size[:, 2:]
        x, y, z = cell.long().unbind(-1)
        first = self.start[:, None] + x * layers + y * rows + z
        corners = [first, first + rows, first + layers, first + layers + rows]
        ends = [(self.values[i], self.values[i + 1]) for i in corners]
        a, b, c, d = (torch.lerp(start, end, w) for start, end in ends)
        p, q, r, s = (end - start for start, end in ends)  # along w
        near, far = torch.lerp(a, b, v), torch.lerp(c, d, v)
        low, high = torch.lerp(p, q, v), torch.lerp(r, s, v)
        slope = torch.stack([far - near, torch.lerp(b - a, d - c, u), torch.lerp(low, high, u)], -1) / pitch
        beyond = (local - inside) * pitch
        outside = torch.linalg.vector_norm(beyond, dim=-1)
        slope = torch.where(beyond == 0, slope, 0.0) + beyond / outside.clamp_min(_TINY)[..., None]
        return torch.lerp(near, far, u) + outside, slope @ self.axes


def _length(vectors: torch.Tensor) -> torch.Tensor:
    """Lengths `[..., 1]` of vectors `[..., 3]`, with a slope at 0, where that of the square root is infinite."""
    return (vectors.square().sum(-1, keepdim=True) + _TINY**2).sqrt() - _TINY
