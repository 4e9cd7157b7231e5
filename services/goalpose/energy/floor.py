"""E_f: nothing below the floor (paper Eq. 9)."""

import torch
from torch import Tensor

from goalpose.energy.figure import Figure
from goalpose.energy.pull import Pull


def floor_energy(figure: Figure, floor_height: float) -> Tensor:
    """E_f = sum_j min(y_j - G_y, 0)^2 over all joints j. -> [B] [m^2]."""
    return (figure.positions[..., 1] - floor_height).clamp(max=0.0).square().sum(-1)


def floor_pull(figure: Figure, floor_height: float) -> tuple[Tensor, Pull]:
    """E_f [B] and its pull."""
    depth = (figure.positions[..., 1] - floor_height).clamp(max=0.0)
    up = torch.zeros_like(figure.positions)
    up[..., 1] = 1.0
    joints = torch.arange(figure.positions.shape[1])
    return depth.square().sum(-1), Pull(joints, figure.positions, 2 * depth[..., None] * up, 2.0 * (depth < 0), up)
