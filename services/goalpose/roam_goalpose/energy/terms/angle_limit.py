"""E_a: joint angles within the limits seen in motion capture, relaxed by 10 degrees (paper Eq. 7 and 8, supplement C).

The paper bounds Euler angles, whose flips leave some joints free (docs/concepts/method.md, 9); here each joint's
rotation is split into a twist about its bone and a swing across it, R = swing * twist, and each of the three angles
has its bounds.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch
from roam_character.rotation import quat_from_rotvec, quat_inv, quat_mul, quat_to_rotvec
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term, squares

LIMITS_FILE = Path(__file__).parent / "angle_limits.json"
RELAXATION = 0.1745  # 10 degrees [rad], supplement C


@dataclass(frozen=True, eq=False)
class AngleLimits:
    """Bounds of the joints that have any."""

    joint: Tensor  # [K]
    axis: Tensor  # [K] 0, 1, 2: the coordinate axis along the bone, about which it twists
    low: Tensor  # [K, 3] [rad] rotation-vector components of the swing; twist in place of the bone's axis
    high: Tensor  # [K, 3] [rad]


def bone_axis(skeleton: Skeleton, joint: int) -> int:
    """The coordinate axis that a joint's bone follows in the rest pose: 0, 1 or 2."""
    children = [c for c, p in enumerate(skeleton.parents) if p == joint]
    tips = [torch.tensor(t.offset) for t in skeleton.tips if t.parent == joint]
    offsets = [torch.as_tensor(skeleton.rest_offsets[c]).float() for c in children] or tips
    if not offsets or skeleton.humanoid_bones[joint].endswith("Foot"):
        return 1  # a foot turns about the shank's axis
    return int(torch.stack(offsets).mean(0).abs().argmax())


def swing_twist(rotations: Tensor, axis: Tensor) -> Tensor:
    """Twist (at the bone's axis) and swing of local rotations [..., K, 4] about bone axes [K]. -> [..., K, 3] [rad]."""
    along = torch.nn.functional.one_hot(axis, 3).to(rotations)
    part = (rotations[..., :3] * along).sum(-1, keepdim=True)
    twist = torch.cat([part * along, rotations[..., 3:]], dim=-1)
    twist = twist / (twist.square().sum(-1, keepdim=True) + 1e-12).sqrt()
    swing = quat_to_rotvec(quat_mul(rotations, quat_inv(twist)))
    return swing * (1 - along) + quat_to_rotvec(twist)


@cache
@torch.inference_mode(mode=False)
def load_limits(skeleton: Skeleton) -> AngleLimits:
    """The shipped limits for the humanoid bones that a skeleton has."""
    table = json.loads(LIMITS_FILE.read_text())["bones"]
    rows = [(j, bone_axis(skeleton, j), table[b]) for j, b in enumerate(skeleton.humanoid_bones) if b in table]
    return AngleLimits(
        torch.tensor([j for j, _, _ in rows]),
        torch.tensor([a for _, a, _ in rows]),
        torch.tensor([r["low"] for _, _, r in rows]) - RELAXATION,
        torch.tensor([r["high"] for _, _, r in rows]) + RELAXATION,
    )


def angle_excess(rotations: Tensor, limits: AngleLimits) -> Tensor:
    """How far the angles of the bounded joints [..., K, 4] lie outside. -> [..., K, 3] [rad], signed."""
    angles = swing_twist(rotations, limits.axis)
    return (angles - limits.high).clamp(min=0.0) - (limits.low - angles).clamp(min=0.0)


def excess_motion(figure: Figure, limits: AngleLimits) -> Tensor:
    """How the excess of B poses moves with the unknowns [B, 3 K, N]: by differences in the joint's own rotation vector,
    the only one that counts."""
    step, bounded = 1e-3, figure.rotations.index_select(1, limits.joint)
    nudges = torch.cat([torch.zeros(1, 3), step * torch.eye(3)])[:, None, None]
    excess = angle_excess(quat_mul(bounded, quat_from_rotvec(nudges)), limits)  # [4, B, K, 3]
    slopes = ((excess[1:] - excess[0]) / step).permute(1, 2, 3, 0)  # [B, K, bound, axis]
    batch, count = bounded.shape[:2]
    motion = torch.zeros(batch, count, 3, 3 + 3 * figure.rotations.shape[1])
    columns = 3 + 3 * limits.joint[:, None] + torch.arange(3)  # [K, axis]
    motion.scatter_(3, columns[None, :, None].expand(batch, -1, 3, -1), slopes)
    return motion.flatten(1, 2)


class AngleLimit(Term):
    """mean_j of the squared excess over the three bounds of joint j [rad^2]."""

    name = "angle_limit"
    symbol = "E_a"
    equation = "mean_j (excess of twist and swing)², limits from motion capture ± 10°"
    weight = 1.0  # [1/rad^2]
    published = 3.283  # 1e-3 deg^-2
    internal = True

    def residual(self, scene: Scene) -> RobustLoss:
        """In the excess of every bound [B, 3 K] [rad]."""
        limits = load_limits(scene.model.skeleton)
        excess = angle_excess(scene.figure.rotations.index_select(1, limits.joint), limits)
        return squares(excess.flatten(1), 1.0 / excess.shape[1])

    def jacobian(self, scene: Scene) -> Tensor:
        """How the excess moves. [B, 3 K, N]."""
        return excess_motion(scene.figure, load_limits(scene.model.skeleton))
