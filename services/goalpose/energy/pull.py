"""How an energy term pulls at points of the body: its first and second order around the present pose.

The optimiser needs no autograd through the skeleton: every term is a function of points fixed to joints, so force and
stiffness at the points, chained with the closed-form motion of points (chain.py), give gradient and Gauss-Newton
matrix.
"""

from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor


class SignedDistance(Protocol):
    """Signed distance to the object's surface, positive outside."""

    def query(self, points: Tensor) -> Tensor:
        """`points` [..., 3] [m] -> [...] [m], differentiable."""
        ...


@dataclass(frozen=True, eq=False)
class Pull:
    """P points with dE/dx and a positive stiffness, along `normal` or, without one, in all directions."""

    joint: Tensor  # [P]
    points: Tensor  # [B, P, 3] world [m]
    force: Tensor  # [B, P, 3] dE/dx
    stiffness: Tensor  # [B, P] second derivative, >= 0
    normal: Tensor | None = None  # [B, P, 3]


def distance_and_normal(distance: SignedDistance, points: Tensor) -> tuple[Tensor, Tensor]:
    """Signed distance [...] and its gradient [..., 3] at points [..., 3]."""
    leaf = points.detach().requires_grad_(True)
    value = distance.query(leaf)
    (gradient,) = torch.autograd.grad(value.sum(), leaf)
    return value.detach(), gradient
