"""E_r: stay near the reference pose in the canonical space (paper Eq. 10; supplement C calls its weight lambda_p)."""

import torch
from roam_character.kinematics import forward_kinematics
from torch import Tensor

from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.rows import Bend, squares


def canonical_positions(figure: Figure) -> Tensor:
    """Joint positions with root translation and orientation removed. -> [B, J, 3] [m]."""
    still = torch.zeros_like(figure.rotations[:, :1])
    still[..., 3] = 1.0
    rotations = torch.cat([still, figure.rotations[:, 1:]], dim=1)
    positions, _ = forward_kinematics(figure.skeleton, torch.zeros_like(figure.root_position), rotations)
    return positions


def prior(figure: Figure, reference: Tensor) -> Bend:
    """E_r = mean_j |F(P'_c)_j - F(P_c)_j|^2 [m^2]. `reference` [1 or B, J, 3] canonical positions [m].

    The differences are taken in the world's axes, around the root: turning both changes no length.
    """
    expected = figure.positions[:, :1] + reference @ figure.axes[:, 0].transpose(-1, -2)
    return squares((figure.positions - expected).flatten(1), 1.0 / figure.positions.shape[1])


def prior_motion(motion: Tensor) -> Tensor:
    """How the differences move, from how the joints do [B, 3 J, N]: the root itself does not count."""
    return torch.cat([torch.zeros_like(motion[..., :6]), motion[..., 6:]], dim=-1)
