"""The whole objective (paper Eq. 6 and the terms beyond it) for a batch of candidate poses."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import torch
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.angle_limit import AngleLimits, angle_excess, angle_limit
from roam_goalpose.energy.clearance import clearance
from roam_goalpose.energy.constraint import NONE, Constraints, constraint, constraint_misses
from roam_goalpose.energy.contact import Contacts, contact, contacts_stack
from roam_goalpose.energy.descriptor import DescriptorField, Probes, descriptor_energy, pose_descriptor
from roam_goalpose.energy.distance import SignedDistance
from roam_goalpose.energy.facing import carried_front, facing
from roam_goalpose.energy.figure import Figure, figure_concat
from roam_goalpose.energy.floor import floor
from roam_goalpose.energy.gravity import carried_up, gravity
from roam_goalpose.energy.penetration import BodyPoints, penetration
from roam_goalpose.energy.prior import prior
from roam_goalpose.energy.self_collision import self_collision_energy
from roam_goalpose.energy.symmetry import symmetry
from roam_goalpose.energy.weights import EnergyWeights


@dataclass(frozen=True, eq=False)
class ReferenceModel:
    """What the energy needs to know of R reference pairs of one skeleton; nothing in it carries gradients.

    Poses are compared with the one there is (R = 1) or each with its own (R = B, picked with `[which]`).
    """

    skeleton: Skeleton
    probes: Probes
    body: BodyPoints
    mirrored: Tensor  # [2, M] left and right body points
    collision_pairs: Tensor  # [2, M]
    limits: AngleLimits
    figure: Figure  # the R reference poses
    canonical: Tensor  # [R, J, 3] joint positions without root transform
    gravity: Tensor  # [R, 3, 3]
    front: Tensor  # [R, 3] the front of the reference object in the pelvis frame, as long as it is clear
    descriptors: Tensor  # [all, P, D] of all references, picked only where they are looked at: they are large
    collision_allowances: Tensor  # [all, M] [m], likewise
    row: Tensor  # [R] which of all the references each is
    nearness: Tensor  # [R, P] 1 at the reference object, falling with distance: far descriptors say little
    allowance: Tensor  # [R, body points] [m]
    contacts: Contacts
    clearances: Tensor  # [R, body points] [m]
    hip_height: Tensor  # [R] of the hips joint above the surface below it [m]
    floor_height: Tensor  # [R]

    def __len__(self) -> int:
        return len(self.figure)

    def __getitem__(self, index: Tensor | slice) -> "ReferenceModel":
        return replace(self, **{name: getattr(self, name)[index] for name in _EACH})

    def descriptors_at(self, chosen: Tensor) -> Tensor:
        """Descriptors of the `chosen` probes [P']. -> [R, P', D]."""
        return self.descriptors[self.row[:, None], chosen]

    @property
    def collision_allowance(self) -> Tensor:
        """How deep each pair of spheres may overlap [R, M] [m]."""
        return self.collision_allowances[self.row]

    @property
    def alone(self) -> "ReferenceModel":
        """The same without what belongs to other references."""
        return replace(self, row=torch.arange(len(self)), **{name: getattr(self, name)[self.row] for name in _SHARED})

    def of(self, which: Tensor) -> "ReferenceModel":
        """What poses made from the references `which` [B] are compared with."""
        return self if len(self) == 1 else self[which]


_EACH = (
    "figure",
    "canonical",
    "gravity",
    "front",
    "row",
    "nearness",
    "allowance",
    "contacts",
    "clearances",
    "hip_height",
    "floor_height",
)
_STRUCTURED = ("figure", "contacts")
_SHARED = ("descriptors", "collision_allowances")


def models_stack(models: Sequence[ReferenceModel]) -> ReferenceModel:
    """Several references of one skeleton, made with the same probes, as one model."""
    tensors: dict[str, Any] = {
        name: torch.cat([getattr(m, name) for m in models]) for name in _EACH if name not in _STRUCTURED
    }
    figure = figure_concat([m.figure for m in models])
    contacts = contacts_stack([m.contacts for m in models])
    tensors |= {name: torch.cat([getattr(m, name) for m in models]) for name in _SHARED}
    tensors["row"] = torch.arange(len(tensors["descriptors"]))
    return replace(models[0], figure=figure, contacts=contacts, **tensors)


def models_joined(models: Sequence[ReferenceModel]) -> ReferenceModel:
    """What the poses of several requests are compared with, a row for every pose."""
    if len(models) == 1:
        return models[0]
    offset = torch.cat([model.probes.offset.expand(len(model), -1, -1) for model in models])
    rows = models_stack([model.alone for model in models])
    return replace(rows, probes=replace(rows.probes, offset=offset))


@dataclass(frozen=True, eq=False)
class Target:
    """The object to pose on."""

    field: DescriptorField
    latent: Any
    distance: SignedDistance
    floor_height: float
    front: Tensor  # [3] away from its back, as long as front and back differ; [B, 1, 3] for several objects
    constraints: Constraints = NONE
    objects: int = 1  # several, when each has its share of the poses, one after the other (`joined.py`)

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


def total_energy(
    figure: Figure, model: ReferenceModel, target: Target, settings: Settings
) -> tuple[Tensor, dict[str, Tensor]]:
    """Weighted sum [B] and every weighted term by name [B]; terms of weight 0 are left out."""
    w = settings.weights
    terms: dict[str, Tensor] = {}
    if w.descriptor:
        terms["descriptor"] = w.descriptor * _descriptor(figure, model, target, settings)
    if w.angle_limit:
        excess = angle_excess(figure.rotations[:, model.limits.joint], model.limits)
        terms["angle_limit"] = w.angle_limit * angle_limit(excess).energy
    if w.floor:
        terms["floor"] = w.floor * floor(figure.positions[..., 1] - target.floor_height).energy
    if w.prior:
        terms["prior"] = w.prior * prior(figure, model.canonical).energy
    if w.contact:
        points = model.contacts.on(figure)
        misses = model.contacts.misses(points[..., 1] - target.floor_height, target.distance.query(points))
        terms["contact"] = w.contact * contact(misses, model.contacts.weight).energy
    terms |= _body_terms(figure, model, target, w)
    if w.facing:
        terms["facing"] = w.facing * facing(carried_front(figure, model.front), target.front).energy
    if w.gravity:
        terms["gravity"] = w.gravity * gravity(carried_up(figure, model.gravity)).energy
    if w.constraint and target.constraints.given:
        terms["constraint"] = w.constraint * constraint(constraint_misses(figure, target.constraints)).energy
    if not terms:
        raise ValueError(f"all weights are 0; set one of {', '.join(f.name for f in fields(w))}")
    return torch.stack(list(terms.values())).sum(0), terms


def _body_terms(figure: Figure, model: ReferenceModel, target: Target, w: EnergyWeights) -> dict[str, Tensor]:
    """What depends on the body's spheres."""
    terms: dict[str, Tensor] = {}
    if not w.looks_at_the_body:
        return terms
    points = model.body.on(figure)
    if w.looks_at_clearances:
        distance = target.distance.query(points)
        if w.penetration:
            found = penetration(distance, model.body.radius, model.allowance)
            terms["penetration"] = w.penetration * found.energy
        if w.clearance:
            terms["clearance"] = w.clearance * clearance(distance, model.clearances).energy
        if w.symmetry:
            terms["symmetry"] = w.symmetry * symmetry(distance, model.clearances, model.mirrored).energy
    if w.self_collision:
        energy = self_collision_energy(points, model.body, model.collision_pairs, model.collision_allowance)
        terms["self_collision"] = w.self_collision * energy
    return terms


@dataclass(frozen=True, eq=False)
class Aim:
    """What the descriptors of R references look at, and how much each counts."""

    chosen: Tensor  # [P'] which probes
    omega: Tensor  # [R, P'], summing to 1
    descriptors: Tensor  # [R, P', D] of the references

    @classmethod
    def of(cls, model: ReferenceModel, settings: Settings) -> "Aim":
        """Of a model's references."""
        chosen = model.probes.thinned(settings.samples)
        omega = torch.where(model.probes.knee[chosen], settings.knee_weight, 1.0)[None]
        if settings.by_nearness:
            omega = omega * model.nearness[:, chosen]
            omega = omega / omega.sum(-1, keepdim=True)
        else:
            omega = omega / len(chosen)
        return cls(chosen, omega, model.descriptors_at(chosen))


def _descriptor(figure: Figure, model: ReferenceModel, target: Target, settings: Settings) -> Tensor:
    aim = Aim.of(model, settings)
    values = pose_descriptor(target.field, target.latent, figure, model.probes, aim.chosen)
    return descriptor_energy(values, aim.descriptors, aim.omega)


def without_descriptor(settings: Settings) -> Settings:
    """The geometric terms alone."""
    return replace(settings, weights=replace(settings.weights, descriptor=0.0))
