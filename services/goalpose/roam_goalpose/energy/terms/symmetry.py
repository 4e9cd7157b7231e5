"""E_b: left and right are as close to the object as each other, as far as they are in the reference (beyond the paper).

Furniture is symmetric, mostly. Sitting askew brings one thigh over the seat's side and the other over its middle;
both may be off the reference's clearance by as much as a straight pose on a seat of another size, but not by
different amounts.
"""

from functools import cache

import torch
from roam_character.body import body_capsules
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.body import BodyPoints, body_points
from roam_goalpose.energy.reference import FAR, PerReference, ReferenceScene
from roam_goalpose.energy.scene import Scene
from roam_goalpose.energy.term import RobustLoss, Term, geman_mcclure
from roam_goalpose.energy.terms.clearance import SCALE


def mirrored_pairs(skeleton: Skeleton, body: BodyPoints) -> Tensor:
    """Spheres of the left and their mirror images on the right. -> [2, M]."""
    partner = torch.tensor(skeleton.mirror)[body.joint]
    flipped = body.offset * torch.tensor([-1.0, 1.0, 1.0])
    gap = torch.cdist(flipped, body.offset) + 1e3 * (partner[:, None] != body.joint[None])
    image = gap.argmin(dim=1)
    first = torch.nonzero(image > torch.arange(len(image)))[:, 0]
    return torch.stack([first, image[first]])


@cache
@torch.inference_mode(mode=False)
def _pairs(skeleton: Skeleton) -> Tensor:
    return mirrored_pairs(skeleton, body_points(body_capsules(skeleton)))


def symmetry(distance: Tensor, reference: Tensor, pairs: Tensor) -> RobustLoss:
    """E_b = mean over pairs of u^2 / (u^2 + s^2), u the difference of the two sides' change in clearance: in [0, 1].

    `distance` [B, P] of the body's spheres [m], `reference` [1 or B, P], `pairs` [2, M]; u is [B, M], which moves as
    the left distance less the right one, each as long as it is below `FAR`.
    """
    change = distance.clamp(max=FAR) - reference
    sides = change.index_select(1, pairs[0]) - change.index_select(1, pairs[1])
    return geman_mcclure(sides, SCALE, 1.0 / pairs.shape[1])


class Symmetry(Term):
    """Robust differences of left and right."""

    name = "symmetry"
    symbol = "E_b"
    equation = "mean over left-right pairs of ρ(difference of the two sides' changes in clearance)"
    weight = 1.5
    coarse = True

    def prepare(self, reference: ReferenceScene) -> PerReference:
        """The reference's clearances [1, P] [m]."""
        return PerReference(reference.clearances)

    def residual(self, scene: Scene) -> RobustLoss:
        """In the differences u [B, M] [m]."""
        reference = scene.model.prepared[self.name]
        assert isinstance(reference, PerReference)
        return symmetry(scene.clearances, reference.values, _pairs(scene.model.skeleton))

    def jacobian(self, scene: Scene) -> Tensor:
        """How u moves, from how the distances do. [B, M, N]."""
        pairs = _pairs(scene.model.skeleton)
        near = scene.clearance_motion * (scene.clearances < FAR)[..., None]
        return near.index_select(1, pairs[0]) - near.index_select(1, pairs[1])
