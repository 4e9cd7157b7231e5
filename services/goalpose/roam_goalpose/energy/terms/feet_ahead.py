"""E_k: feet near enough under the body to rise from and to sit down into (beyond the paper).

Seated people have their ankles 18 to 34 cm ahead of the hip joints. Level thighs and upright shanks bring them to 40 cm
and more: nobody rises from there without rocking, and sitting down into it cannot be balanced. The loss is robust: in
front of a sofa's closed base the feet stay where there is room.
"""

from functools import cache

import numpy as np
import torch
from roam_character.kinematics import Limb, limb
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.reference import PerReference, ReferenceScene
from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term, geman_mcclure
from roam_goalpose.energy.terms.contact import GROUNDED

REACH = 0.72  # of the thigh: how far ahead ankles may be, 29 cm for the 1.69 m body; people's 18 to 34 cm
SCALE = 0.10  # [m] of the Geman-McClure function: feet farther off than this are held off by something
SITTING = 0.25  # [m] that the neck is over the hips at least of whoever sits
_UP = torch.tensor([0.0, 1.0, 0.0])


@cache
def _legs(skeleton: Skeleton) -> tuple[Limb, Limb]:
    return limb(skeleton, "leftLeg"), limb(skeleton, "rightLeg")


def sits(reference: ReferenceScene) -> bool:
    """Whether the trunk of a reference pose is upright."""
    hips, neck = reference.skeleton.indices(["hips", "neck"])
    heights = reference.figure.positions[0, :, 1]
    return bool(heights[neck] - heights[hips] > SITTING)


class FeetAhead(Term):
    """mean over the legs of e^2 / (e^2 + s^2), e how far the ankle is ahead of its hip joint beyond what is easy."""

    name = "feet_ahead"
    symbol = "E_k"
    equation = "mean over legs of ρ(max((ankle − hip joint) · f − 0.72 thigh, 0)), f the pelvis's front on the floor"
    weight = 0.1  # tuned on sofas: at 0.3 hips slide 5 cm forward on the seat to bring the feet back

    def prepare(self, reference: ReferenceScene) -> PerReference:
        """1 for people who sit with their feet on the floor, else 0 [1, 1]."""
        ankles = [leg.end for leg in _legs(reference.skeleton)]
        lowest = reference.figure.positions[0, ankles, 1] - reference.floor_height
        return PerReference(torch.full((1, 1), float(sits(reference) and bool((lowest < GROUNDED).all()))))

    def residual(self, scene: Scene) -> RobustLoss:
        """In how far the ankles are too far ahead [B, 2] [m]."""
        counts = scene.model.prepared[self.name]
        assert isinstance(counts, PerReference)
        return geman_mcclure(self.excess(scene), SCALE, 0.5 * counts.values)

    def jacobian(self, scene: Scene) -> Tensor:
        """How the excess moves. [B, 2, N]."""
        figure, hips = scene.figure, torch.zeros(1, dtype=torch.long)
        left, front = self._directions(scene)
        turned = scene.chain.turning(hips, left[:, None])  # [B, 3, N]
        rows = []
        for leg in _legs(figure.skeleton):
            joints = torch.tensor([leg.end, leg.upper])
            ends = figure.positions.index_select(1, joints)
            moved = scene.chain.along(joints, ends, front[:, None].expand(-1, 2, -1))
            lever = torch.linalg.cross(_UP.expand_as(left), ends[:, 0] - ends[:, 1], dim=-1)
            rows.append(moved[:, :1] - moved[:, 1:] + lever[:, None] @ turned)
        return torch.cat(rows, dim=1) * (self.excess(scene) > 0)[..., None]

    def excess(self, scene: Scene) -> Tensor:
        """How far each ankle is too far ahead of its hip joint [B, 2] [m]."""

        def measured() -> Tensor:
            _, front = self._directions(scene)
            positions, parts = scene.figure.positions, []
            for leg in _legs(scene.figure.skeleton):
                thigh = float(np.linalg.norm(scene.figure.skeleton.rest_offsets[leg.lower]))
                ahead = ((positions[:, leg.end] - positions[:, leg.upper]) * front).sum(-1)
                parts.append((ahead - REACH * thigh).clamp(min=0.0))
            return torch.stack(parts, dim=-1)

        return scene.once("feet ahead", measured)

    @staticmethod
    def _directions(scene: Scene) -> tuple[Tensor, Tensor]:
        """The pelvis's left and its front on the floor [B, 3] each."""
        left = scene.figure.axes[:, 0, :, 0]
        return left, torch.linalg.cross(left, _UP.expand_as(left), dim=-1)
