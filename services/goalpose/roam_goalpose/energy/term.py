"""What an energy term is: a robust loss in scalars of the pose, and how those scalars move with the unknowns.

A term is one file in `energy/terms` and one line in its registry. The coarse search, Gauss-Newton, the paper's solver,
the answer's energies, the weights that callers may set, the studies of `roam evaluate goalpose` and the tables of the
documentation are made from that registry.
"""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

import torch
from torch import Tensor

if TYPE_CHECKING:
    from roam_goalpose.energy.reference import Prepared, ReferenceModel, ReferenceScene
    from roam_goalpose.energy.scene import Scene, Settings, Target


class Loss(Protocol):
    """One term as a function of K scalars of every pose, the residuals."""

    @property
    def energy(self) -> Tensor:
        """[B]."""
        ...

    @property
    def slope(self) -> Tensor:
        """First derivative in every residual. [B, K]."""
        ...

    @property
    def stiffness(self) -> Tensor:
        """Second derivative in every residual, or a positive stand-in; >= 0. [B, K]."""
        ...

    def weighted(self, weight: float) -> "Loss":
        """The same term `weight` times."""
        ...


class RobustLoss(NamedTuple):
    """A `Loss` whose derivatives cost nothing beyond the energy."""

    energy: Tensor  # [B]
    slope: Tensor  # [B, K]
    stiffness: Tensor  # [B, K]

    def weighted(self, weight: float) -> "RobustLoss":
        """The same term `weight` times."""
        return RobustLoss(weight * self.energy, weight * self.slope, weight * self.stiffness)


class Jacobian(NamedTuple):
    """R residuals of every pose: how they move with the N unknowns, and the weighted loss's derivatives in them."""

    motion: Tensor  # [B, R, N] d residual / d unknowns
    slope: Tensor  # [B, R]
    stiffness: Tensor  # [B, R]


class Term(ABC):
    """One term of the energy. Stateless: what it knows of a reference pair is what `prepare` returned.

    Attributes:
        name: in requests, answers, options and studies.
        symbol: in the documentation, "E_d".
        equation: in the documentation.
        weight: of the default solver; 0: only who asks for the term gets it. Lengths are metres, angles radians.
        published: the weight in the paper's last stage (supplement C); None: beyond the paper.
        internal: moving the root alone does not change it.
        coarse: rigid placements are ranked by it before any descriptor is looked at.
        probed: what it prepares depends on the query points, which the request's seed draws.
    """

    name: ClassVar[str]
    symbol: ClassVar[str]
    equation: ClassVar[str]
    weight: ClassVar[float]
    published: ClassVar[float | None] = None
    internal: ClassVar[bool] = False
    coarse: ClassVar[bool] = False
    probed: ClassVar[bool] = False

    @abstractmethod
    def residual(self, scene: "Scene") -> Loss:
        """The loss at B poses, without the weight; differentiable by autograd unless `scene.closed_form`."""

    @abstractmethod
    def jacobian(self, scene: "Scene") -> Tensor:
        """How the residuals move with the unknowns of `scene.chain`. -> [B, K, N]."""

    def prepare(self, reference: "ReferenceScene") -> "Prepared | None":
        """What the term compares with, from one reference pair; None: nothing."""
        return None

    def focus(self, model: "ReferenceModel", settings: "Settings") -> Any:
        """What many scenes with one model and one set of settings share; worked out when first asked for."""
        return None

    def applies(self, target: "Target") -> bool:
        """Whether the target gives the term something to do."""
        return True


def squares(residual: Tensor, weight: float | Tensor = 1.0) -> RobustLoss:
    """sum_k w r_k^2 of residuals [B, K]; `weight` broadcasts."""
    scaled = weight * residual
    return RobustLoss((scaled * residual).sum(-1), 2 * scaled, torch.zeros_like(residual) + 2 * weight)


def geman_mcclure(residual: Tensor, scale: float, weight: float | Tensor) -> RobustLoss:
    """sum_k w e_k^2 / (e_k^2 + s^2), Geman-McClure: from 0 to w for each; `scale` s in the residual's unit.

    The stiffness is that of the reweighted least squares that the function amounts to.
    """
    square = residual.square()
    rounded = square + scale * scale
    firm = weight * (2 * scale * scale) / rounded.square()
    return RobustLoss((weight * square / rounded).sum(-1), firm * residual, firm)


def jacobian_concat(parts: list[Jacobian]) -> Jacobian:
    """The residuals of several terms below each other."""
    return Jacobian(*(torch.cat(column, dim=1) for column in zip(*parts, strict=True)))
