"""E_c: the body's capsules stay out of the object (beyond the paper, which asks for it in section E)."""

from dataclasses import dataclass

import torch
from character.body import Capsules
from torch import Tensor

from goalpose.energy.figure import Figure
from goalpose.energy.pull import Pull, SignedDistance, distance_and_normal


@dataclass(frozen=True, eq=False)
class BodyPoints:
    """Spheres along the capsules' axes: P points fixed to joints, each with its capsule's radius."""

    joint: Tensor  # [P]
    offset: Tensor  # [P, 3] in the joint's frame [m]
    radius: Tensor  # [P] [m]
    capsule: Tensor  # [P] index of the capsule that a point belongs to


def body_points(capsules: Capsules, *, spacing: float = 0.07) -> BodyPoints:
    """Samples every capsule's axis, ends included, at most `spacing` [m] apart."""
    joint, offset, radius, capsule = [], [], [], []
    for c in range(len(capsules.joints)):
        start, end = torch.as_tensor(capsules.starts[c]).float(), torch.as_tensor(capsules.ends[c]).float()
        count = int(torch.ceil((end - start).norm() / spacing)) + 1
        t = torch.linspace(0.0, 1.0, count)[:, None] if count > 1 else torch.full((1, 1), 0.5)
        offset.append(start + t * (end - start))
        joint += [int(capsules.joints[c])] * len(t)
        radius += [float(capsules.radii[c])] * len(t)
        capsule += [c] * len(t)
    return BodyPoints(torch.tensor(joint), torch.cat(offset), torch.tensor(radius), torch.tensor(capsule))


def penetration_depths(figure: Figure, body: BodyPoints, distance: SignedDistance) -> Tensor:
    """How deep each sphere lies in the object, 0 when it does not. -> [B, P] [m]."""
    return (body.radius - distance.query(figure.attached(body.joint, body.offset))).clamp(min=0.0)


def penetration_energy(figure: Figure, body: BodyPoints, distance: SignedDistance, allowance: Tensor) -> Tensor:
    """E_c = mean_p max(r_p - d(x_p) - a_p, 0)^2. `allowance` a [P] [m]: flesh and cushions give. -> [B] [m^2]."""
    return (penetration_depths(figure, body, distance) - allowance).clamp(min=0.0).square().mean(-1)


def penetration_pull(
    figure: Figure, body: BodyPoints, distance: SignedDistance, allowance: Tensor
) -> tuple[Tensor, Pull]:
    """E_c [B] and its pull."""
    points = figure.attached(body.joint, body.offset)
    value, normal = distance_and_normal(distance, points)
    depth = (body.radius - value - allowance).clamp(min=0.0)
    share = 2.0 / len(body.joint)
    pull = Pull(body.joint, points, -share * depth[..., None] * normal, share * (depth > 0), normal)
    return depth.square().mean(-1), pull
