"""What the energy asks of the object's surface."""

from typing import Protocol

from torch import Tensor


class SignedDistance(Protocol):
    """Signed distance to the object's surface, positive outside."""

    def query(self, points: Tensor) -> Tensor:
        """`points` [..., 3] [m] -> [...] [m], differentiable."""
        ...

    def tangent(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Distance [...] [m] and its gradient [..., 3] at `points` [..., 3] [m], without autograd."""
        ...
