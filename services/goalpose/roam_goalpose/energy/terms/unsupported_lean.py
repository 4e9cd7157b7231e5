"""E_l: who leans back has something to lean on (beyond the paper).

A trunk that leans back against air is held by the belly alone: people do not sit so. With a rest at the back, at any
height, leaning is free; without one it costs as much as it leans, and the nearer the rest, the less: so a body that
leans towards a back rest is also drawn to it.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from roam_character.body import body_capsules
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.body import body_points
from roam_goalpose.energy.reference import PerReference, ReferenceScene
from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term
from roam_goalpose.energy.terms.feet_ahead import sits

TRUNK = ("spine", "chest", "upperChest")
LOWEST = 0.3  # of the way from hips to neck: lower points of the back are near every seat
EASY = 0.09  # of the way from hips to neck: how far the neck may be behind them on an upright trunk, about 5 degrees
LEAN = 0.10  # [m] that the neck is farther behind than that: costs 1 in the air
TOUCHING = 0.02  # [m] between back and rest that is no air yet
AIR = 0.05  # [m] of air beyond it that is half a rest
_UP = torch.tensor([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Back:
    """T points on the skin of the back, fixed to joints."""

    joint: Tensor  # [T]
    offset: Tensor  # [T, 3] in the joint's frame [m]


@cache
@torch.inference_mode(mode=False)
def back_of(skeleton: Skeleton) -> Back:
    """Behind the spheres of the trunk that a seat does not touch."""
    body = body_points(body_capsules(skeleton))
    joints = torch.tensor(skeleton.indices(TRUNK))
    rest = torch.tensor(skeleton.ancestors @ skeleton.bone_offsets)[body.joint] + body.offset
    kept = torch.nonzero(torch.isin(body.joint, joints) & (rest[:, 1] > LOWEST * _length(skeleton)))[:, 0]
    behind = body.radius[kept, None] * torch.tensor([0.0, 0.0, -1.0])
    return Back(body.joint[kept], body.offset[kept] + behind)


@cache
def _length(skeleton: Skeleton) -> float:
    """From hips to neck in the rest pose [m]."""
    neck = skeleton.index("neck")
    return float(np.linalg.norm((skeleton.ancestors @ skeleton.bone_offsets)[neck]))


class UnsupportedLean(Term):
    """a(g) (b / 10 cm)^2: b how far the neck is behind the hips, a in [0, 1] how free the back is, g the air there.

    a = g^2 / (g^2 + (5 cm)^2), at the point of the back that is nearest to the object.
    """

    name = "unsupported_lean"
    symbol = "E_l"
    equation = "g² / (g² + (5 cm)²) · (max(behind − 0.09 trunk, 0) / 10 cm)², g the air behind the back"
    weight = 1.0  # tuned on the open test objects: at 0.4 the painted bench still leans 13 degrees on nothing

    def prepare(self, reference: ReferenceScene) -> PerReference:
        """1 for people who sit, else 0 [1]."""
        return PerReference(torch.full((1,), float(sits(reference))))

    def residual(self, scene: Scene) -> RobustLoss:
        """In lean and air [B, 2] [m]."""
        counts = scene.model.prepared[self.name]
        assert isinstance(counts, PerReference)
        lean, air = self.lean(scene), self.air(scene)[0]
        rounded = air.square() + AIR * AIR
        open_, firm = air.square() / rounded, 2 * AIR * AIR / rounded.square()
        costs = counts.values * (lean / LEAN).square()
        by_lean = counts.values * open_ * (2 / (LEAN * LEAN))
        return RobustLoss(
            costs * open_,
            torch.stack([by_lean * lean, costs * firm * air], dim=-1),
            torch.stack([by_lean, costs * firm], dim=-1),
        )

    def jacobian(self, scene: Scene) -> Tensor:
        """How lean and air move. [B, 2, N]."""
        figure, (air, nearest) = scene.figure, self.air(scene)
        joints = torch.tensor(figure.skeleton.indices(["neck", "hips"]))
        ends = figure.positions.index_select(1, joints)
        left = figure.axes[:, 0, :, 0]
        up = _UP.expand_as(left)
        front = torch.linalg.cross(left, up, dim=-1)
        moved = scene.chain.along(joints, ends, front[:, None].expand(-1, 2, -1))
        lever = torch.linalg.cross(up, ends[:, 0] - ends[:, 1], dim=-1)
        turned = scene.chain.turning(torch.zeros(1, dtype=torch.long), left[:, None])
        leaning = (moved[:, 1:] - moved[:, :1] - lever[:, None] @ turned) * (self.lean(scene) > 0)[:, None, None]
        _, points, normal = self.skin(scene)
        row = torch.arange(len(air))
        joint = back_of(figure.skeleton).joint[nearest][:, None]
        airing = scene.chain.along(joint, points[row, nearest][:, None], normal[row, nearest][:, None])
        return torch.cat([leaning, airing * (air > 0)[:, None, None]], dim=1)

    def lean(self, scene: Scene) -> Tensor:
        """How far the neck is too far behind the hips [B] [m]."""

        def measured() -> Tensor:
            figure = scene.figure
            neck, hips = figure.skeleton.indices(["neck", "hips"])
            left = figure.axes[:, 0, :, 0]
            front = torch.linalg.cross(left, _UP.expand_as(left), dim=-1)
            behind = ((figure.positions[:, hips] - figure.positions[:, neck]) * front).sum(-1)
            return (behind - EASY * _length(figure.skeleton)).clamp(min=0.0)

        return scene.once("lean", measured)

    def air(self, scene: Scene) -> tuple[Tensor, Tensor]:
        """Between the back and the object [B] [m], and the point that is nearest to it [B]."""

        def measured() -> tuple[Tensor, Tensor]:
            least, which = self.skin(scene)[0].min(dim=1)
            return (least - TOUCHING).clamp(min=0.0), which

        return scene.once("air behind", measured)

    @staticmethod
    def skin(scene: Scene) -> tuple[Tensor, Tensor, Tensor]:
        """The back's distances from the object [B, T] [m], its points and the object's normals there [B, T, 3]."""

        def look() -> tuple[Tensor, Tensor, Tensor]:
            back = back_of(scene.figure.skeleton)
            points = scene.figure.attached(back.joint, back.offset)
            distance, normal = scene.surface(points)
            return distance, points, normal

        return scene.once("back", look)
