"""E_d: the skeletal pose descriptor of the target matches the reference's (paper section 3.1.2 and Eq. 3.1.3)."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import torch
from torch import Tensor

from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.object import DescriptorField, Linearized
from roam_goalpose.energy.probes import Probes
from roam_goalpose.energy.reference import LargePerReference, ReferenceModel, ReferenceScene
from roam_goalpose.energy.scene import Scene, Settings
from roam_goalpose.energy.term import Loss, RobustLoss, Term

NEAR = 0.15  # [m] from the reference object at which a descriptor counts half


@dataclass(frozen=True, eq=False)
class ReferenceDescriptors:
    """What the descriptor term compares with, for R references."""

    probes: Probes
    descriptors: LargePerReference  # [R, P, D]
    nearness: Tensor  # [R, P] 1 at the reference object, falling with distance: far descriptors say little

    @property
    def width(self) -> Hashable:
        """Number of query points."""
        return self.probes.count

    def __getitem__(self, index: Tensor | slice) -> "ReferenceDescriptors":
        probes = self.probes
        if probes.offset.dim() == 3:
            probes = replace(probes, offset=probes.offset[index])
        return ReferenceDescriptors(probes, self.descriptors[index], self.nearness[index])

    def stacked(self, others: Sequence["ReferenceDescriptors"]) -> "ReferenceDescriptors":
        """With those of `others` below; requests with other seeds have other query points."""
        parts, probes = (self, *others), self.probes
        if any(other.probes.offset is not probes.offset for other in others):
            offset = torch.cat([part.probes.offset.expand(len(part.nearness), -1, -1) for part in parts])
            probes = replace(probes, offset=offset)
        descriptors = self.descriptors.stacked([other.descriptors for other in others])
        return ReferenceDescriptors(probes, descriptors, torch.cat([part.nearness for part in parts]))

    def at(self, chosen: Tensor) -> Tensor:
        """Descriptors of the `chosen` probes [P']. -> [R, P', D]."""
        return self.descriptors.every[self.descriptors.row[:, None], chosen]


@dataclass(frozen=True, eq=False)
class Aim:
    """What the descriptors of R references look at, and how much each counts."""

    chosen: Tensor  # [P'] which probes
    omega: Tensor  # [R, P'], summing to 1
    descriptors: Tensor  # [R, P', D] of the references


def pose_descriptor(field: DescriptorField, latent: Any, figure: Figure, probes: Probes) -> Tensor:
    """Z(O, P), paper Eq. 4 and 5: descriptors at the probes of every pose. -> [B, P, D]."""
    points = figure.attached(probes.joint, probes.offset)
    return _values(field, latent, points)


def _values(field: DescriptorField, latent: Any, points: Tensor) -> Tensor:
    batch, count, _ = points.shape
    return field.descriptor(latent, points.reshape(1, batch * count, 3)).reshape(batch, count, -1)


def _size(difference: Tensor) -> Tensor:
    return difference.abs().sum(-1) / difference.shape[-1] ** 0.5


@dataclass(frozen=True, eq=False)
class DescriptorLoss:
    """E_d at the query points of B poses; the residuals are the points' coordinates.

    A point's difference is like a distance, E ~ k |x - x*|; reweighted least squares then has the stiffness |dE/dx|^2
    / E.
    """

    linearized: Linearized
    difference: Tensor  # [B, P, D] of the descriptors from the reference's
    omega: Tensor  # [1 or B, P]

    @cached_property
    def each(self) -> Tensor:
        """What every point contributes. [B, P]."""
        return _size(self.difference) * self.omega

    @cached_property
    def energy(self) -> Tensor:
        """E_d [B]."""
        return self.each.sum(-1)

    @cached_property
    def slope(self) -> Tensor:
        """[B, 3 P]."""
        return self._slopes.flatten(1)

    def weighted(self, weight: float) -> "DescriptorLoss":
        """The same term `weight` times."""
        return replace(self, omega=weight * self.omega)

    @property
    def stiffness(self) -> Tensor:
        """[B, 3 P]."""
        stiffness = self._slopes.square().sum(-1) / self.each.clamp(min=1e-9)
        return stiffness.repeat_interleave(3, dim=1)

    @cached_property
    def _slopes(self) -> Tensor:
        """Of the energy in every point [B, P, 3]."""
        cotangent = self.difference.sign() * (self.omega[..., None] / self.difference.shape[-1] ** 0.5)
        found = self.linearized.vjp(cotangent.reshape(self.linearized.descriptors.shape))
        return found.reshape(*self.each.shape, 3)


class Descriptor(Term):
    """sum_p w_p |Z'_p - Z_p|_1 / sqrt(D), the weights w_p summing to 1 (paper: omega_j / number of joints).

    Division by sqrt(D) instead of D keeps the term of the order of the descriptors' angle whatever the field's size.
    """

    name = "descriptor"
    symbol = "E_d"
    equation = "Σ_p ω_p ‖Z'_p − Z_p‖₁ / √D at Gaussian clouds (σ = 2.5 cm) round joints and limb midpoints"
    weight = 0.7  # descriptors off by a tenth of a radian cost 0.07
    published = 1.0
    probed = True

    def prepare(self, reference: ReferenceScene) -> ReferenceDescriptors:
        """Descriptors at the probes, and how near those are to the object."""
        probes, figure = reference.probes, reference.figure
        assert probes is not None
        apart = reference.distance.query(figure.attached(probes.joint, probes.offset))
        values = pose_descriptor(reference.field, reference.latent, figure, probes)
        nearness = 1.0 / (1.0 + (apart.clamp(min=0.0) / NEAR).square())
        return ReferenceDescriptors(probes, LargePerReference.of(values), nearness)

    def focus(self, model: ReferenceModel, settings: Settings) -> Aim:
        """Which probes are looked at, and how much each counts."""
        prepared = self.of(model)
        chosen = prepared.probes.thinned(settings.samples)
        omega = torch.where(prepared.probes.knee[chosen], settings.knee_weight, 1.0)[None]
        if settings.by_nearness:
            omega = omega * prepared.nearness[:, chosen]
            omega = omega / omega.sum(-1, keepdim=True)
        else:
            omega = omega / len(chosen)
        return Aim(chosen, omega, prepared.at(chosen))

    def residual(self, scene: Scene) -> Loss:
        """In the coordinates of the query points [B, 3 P]."""
        target, aim = scene.target, self.aim(scene)
        _, points = self.points(scene)
        if scene.closed_form:
            linearized = target.field.linearize(target.latent, points.reshape(target.objects, -1, 3))
            values = linearized.descriptors.reshape(*points.shape[:2], -1)
            return DescriptorLoss(linearized, values - aim.descriptors, aim.omega)
        values = _values(target.field, target.latent, points)
        energy = (_size(values - aim.descriptors) * aim.omega).sum(-1)
        return RobustLoss(energy, points.new_empty(0), points.new_empty(0))

    def jacobian(self, scene: Scene) -> Tensor:
        """How the query points move. [B, 3 P, N]."""
        return scene.chain.free(*self.points(scene))

    def points(self, scene: Scene) -> tuple[Tensor, Tensor]:
        """Joints [P] and places [B, P, 3] of the query points."""
        return scene.once("probes", lambda: self.of(scene.model).probes.on(scene.figure, self.aim(scene).chosen))

    def of(self, model: ReferenceModel) -> ReferenceDescriptors:
        """What was prepared."""
        prepared = model.prepared[self.name]
        assert isinstance(prepared, ReferenceDescriptors)
        return prepared

    def aim(self, scene: Scene) -> Aim:
        """The term's focus."""
        aim = scene.focus(self.name)
        assert isinstance(aim, Aim)
        return aim
