"""B candidate poses beside an object: what the terms look at, each thing computed once however many terms want it."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import torch
from torch import Tensor

from roam_goalpose.energy.chain import Chain
from roam_goalpose.energy.constraints import NONE, Constraints
from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.object import DescriptorField, SignedDistance
from roam_goalpose.energy.reference import ReferenceModel
from roam_goalpose.energy.weights import EnergyWeights

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Target:
    """The object to pose on."""

    field: DescriptorField
    latent: Any
    distance: SignedDistance
    floor_height: float
    front: Tensor  # [3] away from its back, as long as front and back differ; [B, 1, 3] for several objects
    constraints: Constraints = NONE
    objects: int = 1  # several, when each has its share of the poses, one after the other (`solvers/sharing.py`)

    @property
    def rigid(self) -> "Target":
        """The same for poses whose joints do not move yet."""
        return replace(self, constraints=self.constraints.rigid)


@dataclass(frozen=True)
class Settings:
    """How much of the energy to look at."""

    weights: EnergyWeights
    samples: int  # probes per centre
    knee_weight: float = 1.0  # omega of the knees, 3 in the paper's rigid stage
    by_nearness: bool = True  # omega also falls with the distance from the reference object; not in the paper


@dataclass(frozen=True, eq=False)
class Scene:
    """B poses, the references they are compared with, and the object.

    With `closed_form`, distances and descriptors come with their slopes and without autograd; otherwise everything is
    differentiable. The values are the same.
    """

    figure: Figure
    model: ReferenceModel
    target: Target
    settings: Settings
    joints: bool = True  # False: only the root moves, N = 6 unknowns instead of 3 + 3 J
    closed_form: bool = False
    focus: Callable[[str], Any] = lambda name: None  # what `Term.focus` made, by the term's name
    _kept: dict[str, Any] = field(default_factory=dict)

    def once(self, name: str, make: Callable[[], T]) -> T:
        """What `make` makes, the first time it is asked for under this name."""
        if name not in self._kept:
            self._kept[name] = make()
        kept: T = self._kept[name]
        return kept

    @cached_property
    def chain(self) -> Chain:
        """How points move with the unknowns."""
        return Chain.of(self.figure, joints=self.joints)

    @cached_property
    def joint_motion(self) -> Tensor:
        """How the joints do, coordinate by coordinate. [B, 3 J, N]."""
        return self.chain.free(torch.arange(self.figure.positions.shape[1]), self.figure.positions)

    @cached_property
    def heights(self) -> Tensor:
        """Of the joints over the floor [B, J] [m]."""
        return self.figure.positions[..., 1] - self.target.floor_height

    @cached_property
    def spheres(self) -> Tensor:
        """The body's spheres [B, P, 3] [m]."""
        return self.model.body.on(self.figure)

    @cached_property
    def clearances(self) -> Tensor:
        """Distances of the spheres' centres from the object [B, P] [m]."""
        return self._surface_at_spheres[0]

    @cached_property
    def clearance_motion(self) -> Tensor:
        """How those distances move. [B, P, N]."""
        return self.chain.along(self.model.body.joint, self.spheres, self._surface_at_spheres[1])

    @cached_property
    def _surface_at_spheres(self) -> tuple[Tensor, Tensor]:
        return self.surface(self.spheres)

    def surface(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Distance [B, P] [m] and outward normal [B, P, 3] of the object at points [B, P, 3]; the normal only with
        `closed_form`."""
        if self.closed_form:
            return self.target.distance.tangent(points)
        return self.target.distance.query(points), points.new_empty(0)
