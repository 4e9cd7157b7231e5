"""Where descriptors are looked at: Gaussian clouds of query points round joints and limbs (paper Eq. 5)."""

from dataclasses import dataclass
from functools import lru_cache

import torch
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.figure import Figure

LIMBS = ("UpperArm", "LowerArm", "UpperLeg", "LowerLeg")


@dataclass(frozen=True, eq=False)
class Probes:
    """P query points fixed to joints: Gaussian clouds at C centres (joints, limb midpoints), centre by centre."""

    joint: Tensor  # [P]
    offset: Tensor  # [P, 3] in the joint's frame [m], or [R, P, 3], for every reference its own
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


@lru_cache(64)
@torch.inference_mode(mode=False)
def make_probes(skeleton: Skeleton, *, samples: int, sigma: float = 0.025, seed: int = 0) -> Probes:
    """Clouds of `samples` points, x ~ N(centre, sigma [m]), paper Eq. 5; one draw serves all centres and both objects.

    The clouds turn with their joints (the paper's keep the world's axes), so that turning object and pose together
    changes nothing. The first point of every cloud is its centre.
    """
    centres = _centres(skeleton)
    generator = torch.Generator().manual_seed(seed)
    cloud = sigma * torch.randn(samples, 3, generator=generator)
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
