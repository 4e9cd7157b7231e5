"""E_f: nothing below the floor (paper Eq. 9)."""

from torch import Tensor

from goalpose.energy.figure import Figure


def floor_energy(figure: Figure, floor_height: float) -> Tensor:
    """E_f = sum_j min(y_j - G_y, 0)^2 over all joints j. -> [B] [m^2]."""
    return (figure.positions[..., 1] - floor_height).clamp(max=0.0).square().sum(-1)
