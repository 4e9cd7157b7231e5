"""The whole objective (paper Eq. 6 and the terms beyond it) for a batch of candidate poses."""

from dataclasses import dataclass, fields, replace
from typing import Any

import torch
from character.skeleton import Skeleton
from torch import Tensor

from goalpose.energy.angle_limit import AngleLimits, angle_limit_energy
from goalpose.energy.clearance import clearance_energy
from goalpose.energy.contact import Contacts, contact_energy
from goalpose.energy.descriptor import DescriptorField, Probes, descriptor_energy, pose_descriptor
from goalpose.energy.facing import facing_energy
from goalpose.energy.figure import Figure
from goalpose.energy.floor import floor_energy
from goalpose.energy.gravity import gravity_energy
from goalpose.energy.penetration import BodyPoints, penetration_energy
from goalpose.energy.prior import prior_energy
from goalpose.energy.pull import SignedDistance
from goalpose.energy.self_collision import self_collision_energy
from goalpose.energy.symmetry import symmetry_energy
from goalpose.energy.weights import EnergyWeights


@dataclass(frozen=True, eq=False)
class ReferenceModel:
    """What the energy needs to know of a reference pair; computed once, nothing in it carries gradients."""

    skeleton: Skeleton
    figure: Figure  # [1, ...] the reference pose
    canonical: Tensor  # [J, 3] joint positions without root transform
    gravity: Tensor  # [3, 3]
    front: Tensor  # [3] the front of the reference object in the pelvis frame, as long as it is clear
    probes: Probes
    descriptors: Tensor  # [P, D]
    nearness: Tensor  # [P] 1 at the reference object, falling with distance: far descriptors say little
    body: BodyPoints
    allowance: Tensor  # [body points] [m]
    contacts: Contacts
    clearances: Tensor  # [body points] [m]
    mirrored: Tensor  # [2, M] left and right body points
    collision_pairs: Tensor  # [2, M]
    collision_allowance: Tensor  # [M] [m]
    limits: AngleLimits
    hip_height: float  # of the hips joint above the surface below it [m]
    floor_height: float


@dataclass(frozen=True, eq=False)
class Target:
    """The object to pose on."""

    field: DescriptorField
    latent: Any
    distance: SignedDistance
    floor_height: float
    front: Tensor  # [3] the front as the field sees it, as long as it is clear


@dataclass(frozen=True)
class Settings:
    """How much of the energy to look at."""

    weights: EnergyWeights
    samples: int  # probes per centre
    knee_weight: float = 1.0  # omega of the knees, 3 in the paper's rigid stage
    by_nearness: bool = True  # omega also falls with the distance from the reference object; not in the paper


def total_energy(
    figure: Figure, model: ReferenceModel, target: Target, settings: Settings
) -> tuple[Tensor, dict[str, Tensor]]:
    """Weighted sum [B] and every weighted term by name [B]; terms of weight 0 are left out."""
    weights = settings.weights
    terms: dict[str, Tensor] = {}
    if weights.descriptor:
        terms["descriptor"] = weights.descriptor * _descriptor(figure, model, target, settings)
    if weights.angle_limit:
        terms["angle_limit"] = weights.angle_limit * angle_limit_energy(figure, model.limits)
    if weights.floor:
        terms["floor"] = weights.floor * floor_energy(figure, target.floor_height)
    if weights.prior:
        terms["prior"] = weights.prior * prior_energy(figure, model.canonical)
    if weights.penetration:
        terms["penetration"] = weights.penetration * penetration_energy(
            figure, model.body, target.distance, model.allowance
        )
    if weights.contact:
        terms["contact"] = weights.contact * contact_energy(
            figure, model.contacts, target.distance, target.floor_height
        )
    if weights.clearance:
        energy = clearance_energy(figure, model.body, target.distance, model.clearances)
        terms["clearance"] = weights.clearance * energy
    if weights.symmetry:
        energy = symmetry_energy(figure, model.body, target.distance, model.clearances, model.mirrored)
        terms["symmetry"] = weights.symmetry * energy
    if weights.facing:
        terms["facing"] = weights.facing * facing_energy(figure, model.front, target.front)
    if weights.gravity:
        terms["gravity"] = weights.gravity * gravity_energy(figure, model.gravity)
    if weights.self_collision:
        energy = self_collision_energy(figure, model.body, model.collision_pairs, model.collision_allowance)
        terms["self_collision"] = weights.self_collision * energy
    if not terms:
        raise ValueError(f"all weights are 0; set one of {', '.join(f.name for f in fields(weights))}")
    return torch.stack(list(terms.values())).sum(0), terms


def probe_weights(model: ReferenceModel, settings: Settings) -> tuple[Tensor, Tensor]:
    """Which probes are looked at [P'], and their omega [P'], summing to 1."""
    chosen = model.probes.thinned(settings.samples)
    omega = torch.where(model.probes.knee[chosen], settings.knee_weight, 1.0)
    if settings.by_nearness:
        omega = omega * model.nearness[chosen]
        return chosen, omega / omega.sum()
    return chosen, omega / len(chosen)


def _descriptor(figure: Figure, model: ReferenceModel, target: Target, settings: Settings) -> Tensor:
    chosen, omega = probe_weights(model, settings)
    values = pose_descriptor(target.field, target.latent, figure, model.probes, chosen)
    return descriptor_energy(values, model.descriptors[chosen], omega)


def without_descriptor(settings: Settings) -> Settings:
    """The geometric terms alone."""
    return replace(settings, weights=replace(settings.weights, descriptor=0.0))
