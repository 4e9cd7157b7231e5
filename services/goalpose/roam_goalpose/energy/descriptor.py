"""E_d: the skeletal pose descriptor of the target matches the reference's (paper section 3.1.2 and Eq. 3.1.3)."""

from dataclasses import dataclass
from typing import Any, Protocol

import torch
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.rows import Rows

LIMBS = ("UpperArm", "LowerArm", "UpperLeg", "LowerLeg")


class Pulled(Protocol):
    """Descriptors and how they move with their query points."""

    @property
    def descriptors(self) -> Tensor:
        """[B, Q, D]."""
        ...

    def force(self, slope: Tensor) -> Tensor:
        """From the slope of something in the descriptors [B, Q, D] to its slope in the queries [B, Q, 3]."""
        ...


class DescriptorField(Protocol):
    """Psi of the paper: point descriptors around an encoded object, for any rotation of it."""

    def encode(self, points: Tensor) -> Any:
        """Surface points [B, N, 3] [m] -> latent codes."""
        ...

    def descriptor(self, latent: Any, x: Tensor) -> Tensor:
        """Queries [B, Q, 3] [m] -> unit descriptors [B, Q, D], differentiable in x."""
        ...

    def pull(self, latent: Any, x: Tensor) -> Pulled:
        """The same with the slopes in x, without autograd: the solver calls it in inference mode."""
        ...


@dataclass(frozen=True, eq=False)
class Probes:
    """P query points fixed to joints: Gaussian clouds at C centres (joints, limb midpoints), centre by centre."""

    joint: Tensor  # [P]
    offset: Tensor  # [P, 3] in the joint's frame [m], or [B, P, 3], for every pose its own
    centre: Tensor  # [P] which centre a point belongs to
    knee: Tensor  # [P] bool: belongs to a knee, which weighs more in the rigid stage (supplement C)

    @property
    def count(self) -> int:
        """P."""
        return len(self.joint)

    def on(self, figure: Figure, chosen: Tensor) -> tuple[Tensor, Tensor]:
        """The `chosen` points [P']: their joints [P'] and where they are on B poses [B, P', 3] [m]."""
        joint = self.joint[chosen]
        return joint, figure.attached(joint, self.offset[..., chosen, :])

    def thinned(self, samples: int) -> Tensor:
        """Indices of the first `samples` points of every centre."""
        first = torch.searchsorted(self.centre, self.centre)  # of every point's centre, for they lie centre by centre
        return torch.nonzero(torch.arange(len(first)) - first < samples)[:, 0]


def make_probes(skeleton: Skeleton, *, samples: int, sigma: float = 0.025, seed: int = 0) -> Probes:
    """Clouds of `samples` points, x ~ N(centre, sigma [m]), paper Eq. 5; one draw serves all centres and both objects.

    The clouds turn with their joints (the paper's keep the world's axes), so that turning object and pose together
    changes nothing. The first point of every cloud is its centre.
    """
    centres = _centres(skeleton)
    random = torch.Generator().manual_seed(seed)
    cloud = sigma * torch.randn(samples, 3, generator=random)
    cloud[0] = 0.0
    joint = torch.tensor([j for j, _ in centres]).repeat_interleave(samples)
    offset = torch.stack([o for _, o in centres])[:, None] + cloud
    knees = [name.endswith("LowerLeg") for name in skeleton.humanoid_bones]
    at_joint = torch.tensor([bool(o.abs().sum() == 0) and knees[j] for j, o in centres])
    return Probes(
        joint,
        offset.reshape(-1, 3),
        torch.arange(len(centres)).repeat_interleave(samples),
        at_joint.repeat_interleave(samples),
    )


def _centres(skeleton: Skeleton) -> list[tuple[int, Tensor]]:
    """All joints, then the eight virtual joints at the middle of the limbs (supplement C)."""
    centres = [(j, torch.zeros(3)) for j in range(skeleton.joint_count)]
    for j, bone in enumerate(skeleton.humanoid_bones):
        if bone.endswith(LIMBS):
            child = next(c for c, p in enumerate(skeleton.parents) if p == j)
            centres.append((j, torch.as_tensor(skeleton.rest_offsets[child]).float() / 2))
    return centres


def pose_descriptor(
    field: DescriptorField, latent: Any, figure: Figure, probes: Probes, chosen: Tensor | None = None
) -> Tensor:
    """Z(O, P), paper Eq. 4 and 5: descriptors at the probes of every pose. -> [B, P, D]."""
    joint, offset = (probes.joint, probes.offset) if chosen is None else (probes.joint[chosen], probes.offset[chosen])
    points = figure.attached(joint, offset)
    batch, count, _ = points.shape
    values = field.descriptor(latent, points.reshape(1, batch * count, 3))
    return values.reshape(batch, count, -1)


def descriptor_energy(values: Tensor, reference: Tensor, weight: Tensor) -> Tensor:
    """E_d = sum_p w_p |Z'_p - Z_p|_1 / sqrt(D). -> [B].

    `values` [B, P, D], `reference` [1 or B, P, D], `weight` [1 or B, P] summing to 1 (paper: omega_j / number of
    joints). Division by sqrt(D) instead of D keeps the term of the order of the descriptors' angle whatever the
    field's size.
    """
    return (_residual(values, reference) * weight).sum(-1)


def _residual(values: Tensor, reference: Tensor) -> Tensor:
    """|Z' - Z|_1 / sqrt(D) of every probe. -> [B, P]."""
    return _size(values - reference)


def _size(difference: Tensor) -> Tensor:
    return difference.abs().sum(-1) / difference.shape[-1] ** 0.5


@dataclass(frozen=True, eq=False)
class DescriptorBend:
    """E_d at the query points of B poses.

    A point's residual is like a distance, E ~ k |x - x*|; reweighted least squares then has the stiffness |dE/dx|^2
    / E.
    """

    pulled: Pulled
    difference: Tensor  # [B, P, D] of the descriptors from the reference's
    weight: Tensor  # [1 or B, P]

    @property
    def each(self) -> Tensor:
        """What every point contributes. [B, P]."""
        return _size(self.difference) * self.weight

    @property
    def energy(self) -> Tensor:
        """E_d [B]."""
        return self.each.sum(-1)

    def rows(self, motion: Tensor) -> Rows:
        """With how the points' coordinates move [B, 3 P, N]."""
        each, descriptors = self.each, self.pulled.descriptors
        slope = self.difference.sign() * (self.weight[..., None] / self.difference.shape[-1] ** 0.5)
        force = self.pulled.force(slope.reshape(descriptors.shape)).reshape(*each.shape, 3)
        stiffness = force.square().sum(-1) / each.clamp(min=1e-9)
        return Rows(motion, force.flatten(1), stiffness.repeat_interleave(3, dim=1))


def descriptor_bend(
    field: DescriptorField, latent: Any, points: Tensor, reference: Tensor, weight: Tensor, *, objects: int = 1
) -> DescriptorBend:
    """E_d of query points [B, P, 3] [m], of as many poses on each of the `objects` in `latent`, one after the other;
    `reference` and `weight` as in `descriptor_energy`."""
    pulled = field.pull(latent, points.reshape(objects, -1, 3))
    return DescriptorBend(pulled, pulled.descriptors.reshape(*points.shape[:2], -1) - reference, weight)
