"""E_x: arms and legs stay out of the trunk and of each other (beyond the paper)."""

from dataclasses import dataclass
from functools import cache

import torch
from roam_character.body import body_capsules
from roam_character.pose import rest_pose
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.body import BodyPoints, body_points
from roam_goalpose.energy.chain import Chain
from roam_goalpose.energy.figure import Figure, figure_from_pose
from roam_goalpose.energy.reference import LargePerReference, ReferenceScene
from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term
from roam_goalpose.energy.terms.penetration import GIVE

PAIRS = 12  # pairs of spheres that count, the most overlapping ones; more overlap in no pose that is worth finishing


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


@cache
@torch.inference_mode(mode=False)
def _pairs(skeleton: Skeleton) -> Tensor:
    rest = rest_pose(skeleton)
    standing = figure_from_pose(
        skeleton, torch.as_tensor(rest.root_position)[None], torch.as_tensor(rest.rotations)[None]
    )
    return collision_pairs(skeleton, body_points(body_capsules(skeleton)), standing)


def pair_depths(points: Tensor, body: BodyPoints, pairs: Tensor, allowance: Tensor | float = 0.0) -> Tensor:
    """How far the spheres at `points` [B, P, 3] of each pair [2, M] overlap beyond `allowance` [1 or B, M] [m];
    negative: the gap. -> [B, M] [m]."""
    apart = torch.cdist(points, points, compute_mode="donot_use_mm_for_euclid_dist")
    reach = body.radius.index_select(0, pairs[0]) + body.radius.index_select(0, pairs[1]) - allowance
    return reach - apart.flatten(1).index_select(1, pairs[0] * points.shape[1] + pairs[1])


@dataclass(frozen=True, eq=False)
class Overlaps:
    """The `PAIRS` pairs of spheres that overlap most in every pose."""

    depth: Tensor  # [B, M] beyond what is allowed, at least 0 [m]
    first: Tensor  # [B, M] one sphere of each pair
    second: Tensor  # [B, M] the other one
    points: Tensor  # [B, P, 3] all spheres' centres [m]

    @classmethod
    def deepest(cls, points: Tensor, body: BodyPoints, pairs: Tensor, allowance: Tensor) -> "Overlaps":
        """Among `pairs` [2, M'] of the spheres at `points` [B, P, 3], beyond `allowance` [1 or B, M'] [m]."""
        depths = pair_depths(points, body, pairs, allowance)
        depth, which = depths.topk(min(PAIRS, depths.shape[1]), dim=-1)
        return cls(depth.clamp(min=0.0), pairs[0][which], pairs[1][which], points)

    def motion(self, chain: Chain, body: BodyPoints) -> Tensor:
        """How the depths move with the unknowns. -> [B, M, N]."""
        batch = torch.arange(len(self.points))[:, None]
        a, b = self.points[batch, self.first], self.points[batch, self.second]
        normal = torch.nn.functional.normalize(b - a, dim=-1) * (self.depth > 0)[..., None]
        return chain.along(body.joint[self.first], a, normal) - chain.along(body.joint[self.second], b, normal)


class SelfCollision(Term):
    """sum over the deepest pairs of max(overlap - b, 0)^2 [m^2]; b as in the reference: hands press into thighs."""

    name = "self_collision"
    symbol = "E_x"
    equation = f"Σ max(overlap − b, 0)² over the {PAIRS} deepest pairs of the body's spheres"
    weight = 50.0  # [1/m^2] one pair 4.5 cm too deep costs 0.1
    internal = True

    def prepare(self, reference: ReferenceScene) -> LargePerReference:
        """How deep each pair may overlap [1, M] [m]."""
        depths = pair_depths(reference.spheres, reference.body, _pairs(reference.skeleton))
        return LargePerReference.of(depths.clamp(min=0.0) + GIVE)

    def residual(self, scene: Scene) -> RobustLoss:
        """In the overlaps [B, M] [m]."""
        depth = self.overlaps(scene).depth
        return RobustLoss(depth.square().sum(-1), 2 * depth, 2.0 * (depth > 0))

    def jacobian(self, scene: Scene) -> Tensor:
        """How the overlaps move. [B, M, N]."""
        return self.overlaps(scene).motion(scene.chain, scene.model.body)

    def overlaps(self, scene: Scene) -> Overlaps:
        """The deepest ones of every pose."""
        model = scene.model
        allowance = model.prepared[self.name]
        assert isinstance(allowance, LargePerReference)
        return scene.once(
            "overlaps",
            lambda: Overlaps.deepest(scene.spheres, model.body, _pairs(model.skeleton), allowance.values),
        )
