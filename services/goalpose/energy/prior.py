"""E_r: stay near the reference pose in the canonical space (paper Eq. 10; supplement C calls its weight lambda_p)."""

import torch
from character.kinematics import forward_kinematics
from torch import Tensor

from goalpose.energy.figure import Figure


def canonical_positions(figure: Figure) -> Tensor:
    """Joint positions with root translation and orientation removed. -> [B, J, 3] [m]."""
    still = torch.zeros_like(figure.rotations[:, :1])
    still[..., 3] = 1.0
    rotations = torch.cat([still, figure.rotations[:, 1:]], dim=1)
    positions, _ = forward_kinematics(figure.skeleton, torch.zeros_like(figure.root_position), rotations)
    return positions


def prior_energy(figure: Figure, reference: Tensor) -> Tensor:
    """E_r = mean_j |F(P'_c)_j - F(P_c)_j|^2. `reference` [J, 3] canonical positions -> [B] [m^2]."""
    return (canonical_positions(figure) - reference).square().sum(-1).mean(-1)
