"""What the energy asks of an object: its distance anywhere in space, and descriptors round it."""

from typing import Any, Protocol

from torch import Tensor


class SignedDistance(Protocol):
    """Signed distance to the object's surface, positive outside."""

    def query(self, points: Tensor) -> Tensor:
        """`points` [..., 3] [m] -> [...] [m], differentiable."""
        ...

    def tangent(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Distance [...] [m] and its gradient [..., 3] at `points` [..., 3] [m], without autograd."""
        ...


class Linearized(Protocol):
    """Descriptors at query points, and how they move with those."""

    @property
    def descriptors(self) -> Tensor:
        """[B, Q, D]."""
        ...

    def vjp(self, cotangent: Tensor) -> Tensor:
        """Vector-Jacobian product: from the slope of something in the descriptors [B, Q, D] to its slope in the query
        points [B, Q, 3]."""
        ...


class DescriptorField(Protocol):
    """Psi of the paper: point descriptors around an encoded object, for any rotation of it."""

    def encode(self, points: Tensor) -> Any:
        """Surface points [B, N, 3] [m] -> latent codes."""
        ...

    def descriptor(self, latent: Any, x: Tensor) -> Tensor:
        """Queries [B, Q, 3] [m] -> unit descriptors [B, Q, D], differentiable in x."""
        ...

    def linearize(self, latent: Any, x: Tensor) -> Linearized:
        """The same with the slopes in x, without autograd: the solver calls it in inference mode."""
        ...
