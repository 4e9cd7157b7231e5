"""Trunk, arms, shins and feet stay out of the furniture (the paper's section E leaves contact with the object open).

Every limb is a chain of points that its capsules' samples push out along the gradient of the object's signed distance,
bone lengths kept. What a goal pose itself presses into the furniture is allowed, so nothing here pulls a held pose off
its goal; and once a body settles in its goal pose the push ends, lest a hand under an arm rest stays there for ever.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from roam_character.body import body_capsules
from roam_character.distance import DistanceGrids
from roam_character.matrices import matrix_between, unit
from roam_character.skeleton import Skeleton
from roam_character.volume import Volume
from torch import Tensor
from torch.linalg import vector_norm

from roam_motion.animation.figure import Figure
from roam_motion.animation.proportions import size

_SKIN = 0.011  # [m] kept between body and furniture: the grid rounds thin parts off
_ROUNDS = 8  # of pushing
_FASTEST = 0.06, 0.04  # [m] a hand, a foot or the trunk is pushed per frame at most
_MOVED = 0.01  # [m] a foot pushed farther than this cannot stay where it is
_REACH = 0.9  # [m], for legs of 0.82 m, from the hips to the furniture's box within which limbs may touch it
_LET_GO = 0.6, 1.0  # settledness from which the push fades, and at which it is gone
_ARM_SHARES = 0.5, 1.0, 1.35, 1.7, 2.0  # samples along upper arm (to 1) and forearm (to 2)
_SHIN_SHARES = 0.25, 0.5, 0.75, 1.0  # samples along the shin
_ARMS = ("UpperArm", "LowerArm", "Hand")
_TRUNK = ("chest", "upperChest", "neck")  # joints that a back rest may be in the way of
_SIDES = ("left", "right")


@dataclass(frozen=True)
class Limbs:
    """Joints, radii and sample weights of what is kept clear."""

    trunk: Tensor  # [T] joints of the trunk that are samples
    upper: Tensor  # [U] all joints that the spine carries
    trunk_radii: Tensor  # [T] [m]
    arms: Tensor  # [2, 3] upper arm, lower arm, hand
    hands: Tensor  # [2, 3] tip of each hand from its joint, in the hand's frame [m]
    arm_weights: Tensor  # [K, 3] share of shoulder, elbow, wrist in every sample of an arm
    arm_radii: Tensor  # [K] [m]
    shin_radii: Tensor  # [L] of shin samples, then the toes [m]

    @property
    def arm_samples(self) -> int:
        """Samples of an arm, the tip of the hand included."""
        return len(self.arm_radii)


@cache
def limbs_of(figure: Figure) -> Limbs:
    """The limbs of one skeleton."""
    capsules = body_capsules(figure.skeleton)
    radius = {name: float(r) for name, r in zip(capsules.names, capsules.radii, strict=True)}
    weights = [[max(1 - s, 0.0), s if s <= 1 else 2 - s, max(s - 1, 0.0)] for s in _ARM_SHARES]
    arm_radii = [radius["leftUpperArm"] if s <= 1 else radius["leftLowerArm"] for s in _ARM_SHARES]
    tips = [capsules.ends[capsules.names.index(f"{side}Hand")] for side in _SIDES]
    return Limbs(
        trunk=torch.tensor(figure.skeleton.indices(list(_TRUNK))),
        upper=torch.tensor(_carried(figure.skeleton, "spine")),
        trunk_radii=torch.tensor([radius["chest"], radius["upperChest"], radius["neck"]]),
        arms=torch.tensor([figure.skeleton.indices([side + bone for bone in _ARMS]) for side in _SIDES]),
        hands=torch.tensor(np.stack(tips), dtype=torch.float32),
        arm_weights=torch.tensor([*weights, [0.0, 0.0, 1.0]]),
        arm_radii=torch.tensor([*arm_radii, radius["leftHand"]]),
        shin_radii=torch.tensor([radius["leftLowerLeg"]] * len(_SHIN_SHARES) + [radius["leftFoot"]]),
    )


def _carried(skeleton: Skeleton, name: str) -> list[int]:
    """A joint and all below it; parents come first."""
    found = [skeleton.index(name)]
    for joint, parent in enumerate(skeleton.parents):
        if parent in found:
            found.append(joint)
    return found


@dataclass(frozen=True, eq=False)
class Furniture:
    """What B characters keep out of."""

    grids: DistanceGrids  # of their volumes
    allowed: Tensor  # [B, P] depth of every sample that the goal pose itself has [m]
    walked_round: Tensor  # [B] 1, or 0 where one lies down: feet and back go onto such furniture

    def distance(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance [B, P] [m] and its gradient [B, P, 3] at `points` [B, P, 3] [m]."""
        return self.grids.tangent(points)

    def of(self, rows: Tensor) -> "Furniture":
        """That of some of the characters."""
        return Furniture(self.grids.of_rows(rows), self.allowed[rows], self.walked_round[rows])


def furniture_of(volumes: list[Volume], allowed: list[np.ndarray], onto: list[bool]) -> Furniture:
    """The volumes of B characters, who bring feet and back `onto` them or not."""
    return Furniture(
        grids=DistanceGrids.of([volume.grid for volume in volumes]),
        allowed=torch.from_numpy(np.stack(allowed)),
        walked_round=1.0 - torch.tensor(onto, dtype=torch.float32),
    )


def near(figure: Figure, volume: Volume, x: float, z: float) -> bool:
    """Whether a character whose hips are over (x, z) [m] can touch the object."""
    c, s = np.cos(volume.yaw), np.sin(volume.yaw)
    dx, dz = x - float(volume.origin[0]), z - float(volume.origin[2])
    local = np.array([c * dx - s * dz, s * dx + c * dz])
    high = volume.pitch * (np.array(volume.values.shape)[[0, 2]] - 1)
    return bool(np.linalg.norm(local - np.clip(local, 0.0, high)) < _REACH * size(figure))


def goal_depths(figure: Figure, positions: np.ndarray, orientations: np.ndarray, volume: Volume) -> np.ndarray:
    """How deep every sample of a goal pose (joints [J, 3], orientations [J, 3, 3]) lies in its furniture [P] [m]."""
    furniture = furniture_of([volume], [np.zeros(0, np.float32)], [False])
    joints, turns = torch.from_numpy(positions)[None], torch.from_numpy(orientations)[None]
    return _depths(figure, furniture, joints, joints, turns)[0].clamp_min(0.0).numpy()


def _depths(figure: Figure, furniture: Furniture, joints: Tensor, wanted: Tensor, orientations: Tensor) -> Tensor:
    """Depth of every sample [B, P] [m], negative outside; ankles and toes are taken from `wanted` [B, J, 3]."""
    limbs = limbs_of(figure)
    _, shin, foot, toes = figure.legs.T
    arms = _arm_samples(limbs, joints[:, limbs.arms], _tips(limbs, orientations))
    shins = _shin_samples(joints[:, shin], wanted[:, foot], wanted[:, toes])
    gap, _ = furniture.distance(torch.cat([arms.flatten(1, 2), shins.flatten(1, 2), joints[:, limbs.trunk]], 1))
    return _radii(limbs) + _SKIN - gap


def keep_clear(
    figure: Figure, furniture: Furniture, wanted: Tensor, orientations: Tensor, settled: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Wanted joints [B, J, 3] (of them ankles and toes) and orientations [B, J, 3, 3] (of the arms), out of the object.

    `settled` [B] ends the push. The third answer [B, 2] tells which feet had to move.
    """
    weight = 1 - ((settled - _LET_GO[0]) / (_LET_GO[1] - _LET_GO[0])).clamp(0.0, 1.0)
    joints = figure.positions(wanted[:, 0], orientations)
    # Most bodies touch nothing most of the time: they stay as they are, to the bit.
    touching = (_depths(figure, furniture, joints, wanted, orientations) > furniture.allowed).any(1) & (weight > 0)
    wanted, orientations, pushed = wanted.clone(), orientations.clone(), torch.zeros(len(wanted), 2, dtype=torch.bool)
    rows = touching.nonzero()[:, 0]
    if len(rows):
        moved = _pushed_out(figure, furniture.of(rows), wanted[rows], orientations[rows], weight[rows])
        wanted[rows], orientations[rows], pushed[rows] = moved
    return wanted, orientations, pushed


def _pushed_out(
    figure: Figure, furniture: Furniture, wanted: Tensor, orientations: Tensor, weight: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """`keep_clear` for those that touch something, by a `weight` [B]."""
    limbs = limbs_of(figure)
    joints = figure.positions(wanted[:, 0], orientations)
    orientations = _trunk_cleared(furniture, limbs, joints, orientations, weight * furniture.walked_round)
    joints = figure.positions(wanted[:, 0], orientations)
    orientations = _arms_cleared(furniture, limbs, joints, orientations, weight)
    shift = _feet_shift(figure, furniture, limbs, joints, wanted, weight * furniture.walked_round)
    cleared = wanted.clone()
    cleared[:, figure.contacts] += shift.repeat_interleave(2, 1)
    return cleared, orientations, vector_norm(shift, dim=-1) > _MOVED


def _radii(limbs: Limbs) -> Tensor:
    """Of all samples [P]: both arms, both shins, the trunk."""
    return torch.cat([limbs.arm_radii.repeat(2), limbs.shin_radii.repeat(2), limbs.trunk_radii])


def _tips(limbs: Limbs, orientations: Tensor) -> Tensor:
    """From wrists to the tips of the hands [B, 2, 3] [m]."""
    return (orientations[:, limbs.arms[:, 2]] @ limbs.hands[..., None])[..., 0]


def _arm_samples(limbs: Limbs, arms: Tensor, tips: Tensor) -> Tensor:
    """Points [B, 2, K, 3] along arms [B, 2, 3 joints, 3]."""
    points = limbs.arm_weights @ arms
    return torch.cat([points[:, :, :-1], points[:, :, -1:] + tips[:, :, None]], 2)


def _shin_samples(knees: Tensor, ankles: Tensor, toes: Tensor) -> Tensor:
    """Points [B, 2, L, 3] along shins, and toes."""
    along = [torch.lerp(knees, ankles, share) for share in _SHIN_SHARES]
    return torch.stack([*along, toes], 2)


def _pushes(furniture: Furniture, points: Tensor, radii: Tensor, allowed: Tensor) -> tuple[Tensor, Tensor]:
    """Depth [B, 2, K] [m] beyond what is allowed, and the push [B, 2, K, 3] [m] that ends it."""
    gap, slope = furniture.distance(points.flatten(1, 2))
    depth = (radii + _SKIN - gap.unflatten(1, points.shape[1:3]) - allowed).clamp_min(0.0)
    return depth, depth[..., None] * unit(slope).unflatten(1, points.shape[1:3])


def _trunk_cleared(furniture: Furniture, limbs: Limbs, joints: Tensor, orientations: Tensor, weight: Tensor) -> Tensor:
    """Orientations with all that the spine carries turned about the hips, away from the object."""
    allowed = furniture.allowed[:, -len(limbs.trunk) :]
    gap, slope = furniture.distance(joints[:, limbs.trunk])
    depth = (limbs.trunk_radii + _SKIN - gap - allowed).clamp_min(0.0)
    levers = vector_norm(joints[:, limbs.trunk] - joints[:, :1], dim=-1)
    push = (depth * depth * levers[:, 1:2] / levers)[..., None] * unit(slope)
    push = push.sum(1) / depth.sum(1, keepdim=True).clamp_min(1e-6)
    push = push * (_FASTEST[1] / vector_norm(push, dim=-1, keepdim=True).clamp_min(1e-6)).clamp_max(1.0)
    arm = joints[:, limbs.trunk[1]] - joints[:, 0]
    turn = matrix_between(arm, arm + weight[:, None] * push)
    turned = orientations.clone()
    turned[:, limbs.upper] = turn[:, None] @ orientations[:, limbs.upper]
    return turned


def _arms_cleared(furniture: Furniture, limbs: Limbs, joints: Tensor, orientations: Tensor, weight: Tensor) -> Tensor:
    """Orientations with the arms turned away from the object."""
    arms, tips = joints[:, limbs.arms], _tips(limbs, orientations)
    shoulder, elbow, wrist = arms.unbind(2)
    lengths = vector_norm(elbow - shoulder, dim=-1, keepdim=True), vector_norm(wrist - elbow, dim=-1, keepdim=True)
    allowed = furniture.allowed[:, : 2 * limbs.arm_samples].unflatten(1, (2, -1))
    for _ in range(_ROUNDS):
        points = _arm_samples(limbs, torch.stack([shoulder, elbow, wrist], 2), tips)
        depth, push = _pushes(furniture, points, limbs.arm_radii, allowed)
        elbow = elbow + weight[:, None, None] * _shared(depth, push, limbs.arm_weights[:, 1])
        wrist = wrist + weight[:, None, None] * _shared(depth, push, limbs.arm_weights[:, 2])
        elbow = shoulder + lengths[0] * unit(elbow - shoulder)
        wrist = elbow + lengths[1] * unit(wrist - elbow)
    far = vector_norm(torch.stack([elbow, wrist], 2) - arms[:, :, 1:], dim=-1).amax(-1, keepdim=True)
    share = (_FASTEST[0] / far.clamp_min(1e-6)).clamp_max(1.0)
    elbow, wrist = torch.lerp(arms[:, :, 1], elbow, share), torch.lerp(arms[:, :, 2], wrist, share)
    upper = matrix_between(arms[:, :, 1] - shoulder, elbow - shoulder)
    lower = matrix_between(arms[:, :, 2] - arms[:, :, 1], wrist - elbow)
    turned = orientations.clone()
    turned[:, limbs.arms] = torch.stack([upper, lower, lower], 2) @ orientations[:, limbs.arms]
    return turned


def _shared(depth: Tensor, push: Tensor, share: Tensor) -> Tensor:
    """What all samples' pushes move one joint by [B, 2, 3]: their mean by depth and by the joint's share in each."""
    count = depth * share
    return (count[..., None] * push).sum(2) / count.sum(2, keepdim=True).clamp_min(1e-6)


def _feet_shift(
    figure: Figure, furniture: Furniture, limbs: Limbs, joints: Tensor, wanted: Tensor, weight: Tensor
) -> Tensor:
    """What feet move by [B, 2, 3] until the shins are clear [m]."""
    _, shin, foot, toes = figure.legs.T
    allowed = furniture.allowed[:, 2 * limbs.arm_samples : -len(limbs.trunk)].unflatten(1, (2, -1))
    shares = torch.tensor([*_SHIN_SHARES, 1.0])
    down = torch.tensor([-torch.inf, 0.0, -torch.inf])  # feet go over things, never into the floor
    shift = torch.zeros_like(wanted[:, foot])
    for _ in range(_ROUNDS):
        points = _shin_samples(joints[:, shin], wanted[:, foot] + shift, wanted[:, toes] + shift)
        depth, push = _pushes(furniture, points, limbs.shin_radii, allowed)
        shift = (shift + weight[:, None, None] * _shared(depth, push, shares)).maximum(down)
    return shift * (_FASTEST[1] / vector_norm(shift, dim=-1, keepdim=True).clamp_min(1e-6)).clamp_max(1.0)
