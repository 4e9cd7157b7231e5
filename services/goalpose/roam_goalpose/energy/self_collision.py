"""E_x: arms and legs stay out of the trunk and of each other (beyond the paper)."""

from dataclasses import dataclass

import torch
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.chain import Chain
from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.penetration import BodyPoints
from roam_goalpose.energy.rows import Bend

PAIRS = 12  # colliding pairs of spheres that the expansion looks at


def collision_pairs(skeleton: Skeleton, body: BodyPoints, rest: Figure) -> Tensor:
    """Pairs of spheres that may collide: more than two bones apart, and clear of each other in `rest`. -> [2, M]."""
    hops = _joint_hops(skeleton)
    i, j = torch.triu_indices(len(body.joint), len(body.joint), 1)
    apart = hops[body.joint[i], body.joint[j]] > 2
    points = body.on(rest)[0]
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


def pair_depths(points: Tensor, body: BodyPoints, pairs: Tensor) -> Tensor:
    """How far the spheres at `points` [B, P, 3] of each pair [2, M] overlap; negative: the gap. -> [B, M] [m]."""
    apart = (points.index_select(1, pairs[0]) - points.index_select(1, pairs[1])).square().sum(-1).add(1e-9).sqrt()
    return body.radius[pairs[0]] + body.radius[pairs[1]] - apart


def self_collision_energy(points: Tensor, body: BodyPoints, pairs: Tensor, allowance: Tensor) -> Tensor:
    """E_x = sum over pairs of max(overlap - b, 0)^2 [m^2]; `allowance` b [1 or B, M] [m]: hands press into thighs.

    -> [B].
    """
    return (pair_depths(points, body, pairs) - allowance).clamp(min=0.0).square().sum(-1)


@dataclass(frozen=True, eq=False)
class Pairs:
    """The `PAIRS` pairs of spheres that overlap most in every pose."""

    overlap: Tensor  # [B, M] beyond what is allowed, at least 0 [m]
    first: Tensor  # [B, M] one sphere of each pair
    second: Tensor  # [B, M] the other one
    points: Tensor  # [B, P, 3] all spheres' centres [m]

    def bend(self) -> Bend:
        """E_x in the overlaps."""
        overlap = self.overlap
        return Bend(overlap.square().sum(-1), 2 * overlap, 2.0 * (overlap > 0))

    def motion(self, chain: Chain, body: BodyPoints) -> Tensor:
        """How the overlaps move with the unknowns. -> [B, M, N]."""
        batch = torch.arange(len(self.points))[:, None]
        a, b = self.points[batch, self.first], self.points[batch, self.second]
        normal = torch.nn.functional.normalize(b - a, dim=-1) * (self.overlap > 0)[..., None]
        return chain.along(body.joint[self.first], a, normal) - chain.along(body.joint[self.second], b, normal)


def deepest_pairs(points: Tensor, body: BodyPoints, pairs: Tensor, allowance: Tensor) -> Pairs:
    """Which `pairs` [2, M] of the spheres at `points` [B, P, 3] overlap most, beyond `allowance` [1 or B, M] [m]."""
    apart = torch.cdist(points, points, compute_mode="donot_use_mm_for_euclid_dist")
    reach = body.radius.index_select(0, pairs[0]) + body.radius.index_select(0, pairs[1]) - allowance
    depth = reach - apart.flatten(1).index_select(1, pairs[0] * points.shape[1] + pairs[1])
    overlap, which = depth.topk(min(PAIRS, depth.shape[1]), dim=-1)
    return Pairs(overlap.clamp(min=0.0), pairs[0][which], pairs[1][which], points)
