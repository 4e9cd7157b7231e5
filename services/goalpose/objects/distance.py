"""Signed distance to an object, anywhere in space, differentiable."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import torch


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
        local = self._local(x)
        inside, corners, (u, v, w) = self._cell(local)
        (near, up), (far, far_up) = ((a + (b - a) * w for a, b in side) for side in corners)
        lower, upper = near + (up - near) * v, far + (far_up - far) * v
        # The square root's slope at 0 is infinite; the tiny constant keeps gradients finite inside the grid.
        outside = ((local - inside).square().sum(-1) + 1e-12).sqrt() - 1e-6
        return lower + (upper - lower) * u + outside

    def tangent(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Distance `[...]` [m] and its gradient `[..., 3]` at world points `[..., 3]` [m], in closed form."""
        import torch

        local = self._local(x)
        inside, corners, (u, v, w) = self._cell(local)
        slopes = [[b - a for a, b in side] for side in corners]
        (near, up), (far, far_up) = ((a + (b - a) * w for a, b in side) for side in corners)
        lower, upper = near + (up - near) * v, far + (far_up - far) * v
        along_v = (up - near) + ((far_up - far) - (up - near)) * u
        (s, t), (p, q) = slopes
        along_w = (s + (t - s) * v) * (1 - u) + (p + (q - p) * v) * u
        gradient = torch.stack([upper - lower, along_v, along_w], dim=-1) / self.pitch
        beyond = local - inside
        far_away = (beyond.square().sum(-1, keepdim=True) + 1e-12).sqrt()
        gradient = torch.where(beyond == 0, gradient, 0.0) + beyond / far_away
        return lower + (upper - lower) * u + far_away[..., 0] - 1e-6, self._world(gradient)

    def _cell(
        self, local: torch.Tensor
    ) -> tuple[torch.Tensor, list[list[tuple[torch.Tensor, torch.Tensor]]], tuple[torch.Tensor, ...]]:
        """The nearest points in the grid's box, the values at the corners of their cells, by x, y and z, and the
        places in the cells along x, y and z."""
        import torch  # here, so that the process that only parses uploads need not load it

        values, low, high, strides = self._tensors
        values, low, high = values.to(local), low.to(local), high.to(local)
        inside = torch.minimum(torch.maximum(local, low), high)
        cell = (inside - low) / self.pitch
        corner = torch.minimum(cell.detach().floor(), (high - low).div(self.pitch).round() - 1).clamp_min(0)
        index = (corner.long() * strides).sum(-1)
        sx, sy, _ = (int(s) for s in strides)
        ends = [[(values[index + i + j], values[index + i + j + 1]) for j in (0, sy)] for i in (0, sx)]
        return inside, ends, (cell - corner).unbind(-1)

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
    def _tensors(self) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        import torch

        size = np.array(self.values.shape)
        strides = torch.tensor([size[1] * size[2], size[2], 1])
        low = torch.as_tensor(self.origin)
        return torch.tensor(self.values).reshape(-1), low, low + torch.as_tensor((size - 1) * self.pitch), strides
