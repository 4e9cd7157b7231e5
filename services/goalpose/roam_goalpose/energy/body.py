"""The body as spheres along its capsules: what is measured against the object."""

from dataclasses import dataclass

import torch
from roam_character.body import Capsules
from torch import Tensor

from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.object import SignedDistance


@dataclass(frozen=True, eq=False)
class BodyPoints:
    """Spheres along the capsules' axes: P points fixed to joints, each with its capsule's radius."""

    joint: Tensor  # [P]
    offset: Tensor  # [P, 3] in the joint's frame [m]
    radius: Tensor  # [P] [m]
    capsule: Tensor  # [P] index of the capsule that a point belongs to

    def on(self, figure: Figure) -> Tensor:
        """The spheres' centres [B, P, 3] [m]."""
        return figure.attached(self.joint, self.offset)


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
    return (body.radius - distance.query(body.on(figure))).clamp(min=0.0)
