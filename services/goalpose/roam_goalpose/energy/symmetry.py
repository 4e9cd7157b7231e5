"""E_b: left and right are as close to the object as each other, as far as they are in the reference (beyond the paper).

Furniture is symmetric, mostly. Sitting askew brings one thigh over the seat's side and the other over its middle;
both may be off the reference's clearance by as much as a straight pose on a seat of another size, but not by
different amounts.
"""

import torch
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.clearance import FAR, SCALE
from roam_goalpose.energy.penetration import BodyPoints
from roam_goalpose.energy.rows import Bend, robust


def mirrored_pairs(skeleton: Skeleton, body: BodyPoints) -> Tensor:
    """Spheres of the left and their mirror images on the right. -> [2, M]."""
    partner = torch.tensor(skeleton.mirror)[body.joint]
    flipped = body.offset * torch.tensor([-1.0, 1.0, 1.0])
    gap = torch.cdist(flipped, body.offset) + 1e3 * (partner[:, None] != body.joint[None])
    image = gap.argmin(dim=1)
    first = torch.nonzero(image > torch.arange(len(image)))[:, 0]
    return torch.stack([first, image[first]])


def symmetry(distance: Tensor, reference: Tensor, pairs: Tensor) -> Bend:
    """E_b = mean over pairs of u^2 / (u^2 + s^2), u the difference of the two sides' change in clearance: in [0, 1].

    `distance` [B, P] of the body's spheres [m], `reference` [1 or B, P], `pairs` [2, M]; bends in u [B, M], which
    moves as the left distance less the right one, each as long as it is below `FAR`.
    """
    change = distance.clamp(max=FAR) - reference
    return robust(change.index_select(1, pairs[0]) - change.index_select(1, pairs[1]), SCALE, 1.0 / pairs.shape[1])


def symmetry_motion(motion: Tensor, distance: Tensor, pairs: Tensor) -> Tensor:
    """How u moves, from how the distances do: `motion` [B, P, N] -> [B, M, N]."""
    near = motion * (distance < FAR)[..., None]
    return near.index_select(1, pairs[0]) - near.index_select(1, pairs[1])
