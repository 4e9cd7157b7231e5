"""E_f: nothing below the floor (paper Eq. 9)."""

from torch import Tensor

from roam_goalpose.energy.rows import Bend


def floor(height: Tensor) -> Bend:
    """E_f = sum_j min(y_j - G_y, 0)^2 [m^2] of the joints' `height` [B, J] above the floor [m]."""
    depth = height.clamp(max=0.0)
    return Bend(depth.square().sum(-1), 2 * depth, 2.0 * (depth < 0))
