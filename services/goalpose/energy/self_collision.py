"""E_x: arms and legs stay out of the trunk and of each other (beyond the paper)."""

import torch
from character.skeleton import Skeleton
from torch import Tensor

from goalpose.energy.figure import Figure
from goalpose.energy.penetration import BodyPoints


def collision_pairs(skeleton: Skeleton, body: BodyPoints, rest: Figure) -> Tensor:
    """Pairs of spheres that may collide: more than two bones apart, and clear of each other in `rest`. -> [2, M]."""
    hops = _joint_hops(skeleton)
    i, j = torch.triu_indices(len(body.joint), len(body.joint), 1)
    apart = hops[body.joint[i], body.joint[j]] > 2
    points = rest.attached(body.joint, body.offset)[0]
    gap = (points[i] - points[j]).norm(dim=-1) - body.radius[i] - body.radius[j]
    keep = apart & (gap > 0)
    return torch.stack([i[keep], j[keep]])


def _joint_hops(skeleton: Skeleton) -> Tensor:
    """Number of bones between joints, up to 3. -> [J, J]."""
    count = skeleton.joint_count
    adjacent = torch.eye(count, dtype=torch.bool)
    for j, p in enumerate(skeleton.parents):
        if p >= 0:
            adjacent[j, p] = adjacent[p, j] = True
    two = (adjacent.float() @ adjacent.float()) > 0
    return torch.where(torch.eye(count, dtype=torch.bool), 0, torch.where(adjacent, 1, torch.where(two, 2, 3)))


def pair_depths(figure: Figure, body: BodyPoints, pairs: Tensor) -> Tensor:
    """How far the spheres of each pair overlap; negative: the gap between them. `pairs` [2, M] -> [B, M] [m]."""
    points = figure.attached(body.joint, body.offset)
    apart = (points[:, pairs[0]] - points[:, pairs[1]]).square().sum(-1).add(1e-9).sqrt()
    return body.radius[pairs[0]] + body.radius[pairs[1]] - apart


def self_collision_energy(figure: Figure, body: BodyPoints, pairs: Tensor, allowance: Tensor) -> Tensor:
    """E_x = sum over pairs of max(overlap - b, 0)^2; `allowance` b [M] [m]: hands press into thighs. -> [B] [m^2]."""
    return (pair_depths(figure, body, pairs) - allowance).clamp(min=0.0).square().sum(-1)


def deepest_pairs(
    figure: Figure, body: BodyPoints, pairs: Tensor, allowance: Tensor, count: int
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """The `count` pairs of every candidate that overlap most.

    Returns overlaps [B, count] [m] (negative: a gap), first and second sphere [B, count], and all spheres [B, P, 3].
    """
    points = figure.attached(body.joint, body.offset)
    apart = torch.cdist(points, points, compute_mode="donot_use_mm_for_euclid_dist")
    depth = (body.radius[pairs[0]] + body.radius[pairs[1]] - allowance) - apart[:, pairs[0], pairs[1]]
    overlap, which = depth.topk(min(count, depth.shape[1]), dim=-1)
    return overlap, pairs[0][which], pairs[1][which], points
