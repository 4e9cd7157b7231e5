"""Signed distance to an object, anywhere in space, differentiable."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import torch


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """Signed distance [m] to the object's surface, negative inside, interpolated between grid nodes.

    Outside the grid the value at the nearest point of the grid's box plus the distance to that point: an upper bound
    that still points the right way.

    Attributes:
        origin: `[3]` position of node (0, 0, 0) [m].
        pitch: node spacing [m].
        values: `[X, Y, Z]` float32 [m].
    """

    origin: npt.NDArray[np.float64]
    pitch: float
    values: npt.NDArray[np.float32]

    def query(self, x: torch.Tensor) -> torch.Tensor:
        """Distance `[...]` [m] at world points `[..., 3]` [m]; differentiable in `x` (piecewise trilinear)."""
        import torch  # here, so that the process that only parses uploads need not load it

        values, low, high, strides = self._tensors
        values, low, high = values.to(x), low.to(x), high.to(x)
        inside = torch.minimum(torch.maximum(x, low), high)
        cell = (inside - low) / self.pitch
        corner = torch.minimum(cell.detach().floor(), (high - low).div(self.pitch).round() - 1).clamp_min(0)
        fraction = cell - corner
        index = (corner.long() * strides.to(x.device)).sum(-1)
        sx, sy, sz = (int(s) for s in strides)
        u, v, w = fraction.unbind(-1)
        near = values[index] * (1 - w) + values[index + sz] * w
        up = values[index + sy] * (1 - w) + values[index + sy + sz] * w
        far = values[index + sx] * (1 - w) + values[index + sx + sz] * w
        far_up = values[index + sx + sy] * (1 - w) + values[index + sx + sy + sz] * w
        value = (near * (1 - v) + up * v) * (1 - u) + (far * (1 - v) + far_up * v) * u
        # The square root's slope at 0 is infinite; the tiny constant keeps gradients finite inside the grid.
        outside = ((x - inside).square().sum(-1) + 1e-12).sqrt() - 1e-6
        return value + outside

    def sample(self, points: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
        """`query` for numpy points `[..., 3]`, without gradients."""
        import torch

        with torch.no_grad():
            result: npt.NDArray[np.float32] = self.query(torch.as_tensor(points, dtype=torch.float32)).numpy()
        return result

    @cached_property
    def _tensors(self) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        import torch

        size = np.array(self.values.shape)
        strides = torch.tensor([size[1] * size[2], size[2], 1])
        low = torch.as_tensor(self.origin)
        return torch.tensor(self.values).reshape(-1), low, low + torch.as_tensor((size - 1) * self.pitch), strides
