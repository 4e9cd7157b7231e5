"""E_b: left and right are as close to the object as each other, as far as they are in the reference (beyond the paper).

Furniture is symmetric, mostly. Sitting askew brings one thigh over the seat's side and the other over its middle;
both may be off the reference's clearance by as much as a straight pose on a seat of another size, but not by
different amounts.
"""

import torch
from character.skeleton import Skeleton
from torch import Tensor

from goalpose.energy.chain import point_motion
from goalpose.energy.clearance import FAR, SCALE, clearances
from goalpose.energy.contact import robust
from goalpose.energy.figure import Figure
from goalpose.energy.penetration import BodyPoints
from goalpose.energy.pull import SignedDistance, distance_and_normal


def mirrored_pairs(skeleton: Skeleton, body: BodyPoints) -> Tensor:
    """Spheres of the left and their mirror images on the right. -> [2, M]."""
    partner = torch.tensor(skeleton.mirror)[body.joint]
    flipped = body.offset * torch.tensor([-1.0, 1.0, 1.0])
    gap = torch.cdist(flipped, body.offset) + 1e3 * (partner[:, None] != body.joint[None])
    image = gap.argmin(dim=1)
    first = torch.nonzero(image > torch.arange(len(image)))[:, 0]
    return torch.stack([first, image[first]])


def symmetry_energy(
    figure: Figure, body: BodyPoints, distance: SignedDistance, reference: Tensor, pairs: Tensor
) -> Tensor:
    """E_b = mean over pairs of u^2 / (u^2 + s^2), u the difference of the two sides' change in clearance. -> [B]."""
    change = clearances(figure, body, distance) - reference
    return robust(change[:, pairs[0]] - change[:, pairs[1]], SCALE).mean(-1)


def symmetry_rows(
    figure: Figure, body: BodyPoints, distance: SignedDistance, reference: Tensor, pairs: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """E_b [B], and residuals [B, M] with Jacobians [B, M, N] whose halved squares have its gradient."""
    points = figure.attached(body.joint, body.offset)
    value, normal = distance_and_normal(distance, points)
    change = value.clamp(max=FAR) - reference
    normal = normal * (value < FAR)[..., None]
    u = change[:, pairs[0]] - change[:, pairs[1]]
    sides = [
        (point_motion(figure, body.joint[side], points[:, side]) * normal[:, side, :, None]).sum(-2) for side in pairs
    ]
    firm = (2 * SCALE**2 / pairs.shape[1]) ** 0.5 / (u.square() + SCALE**2)
    return robust(u, SCALE).mean(-1), firm * u, firm[..., None] * (sides[0] - sides[1])
