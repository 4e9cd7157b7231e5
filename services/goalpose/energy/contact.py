"""E_s: touch the object where the reference touches it, and the floor with the soles (beyond the paper)."""

from dataclasses import dataclass

import torch
from torch import Tensor

from goalpose.energy.figure import Figure
from goalpose.energy.penetration import BodyPoints
from goalpose.energy.pull import Pull, SignedDistance, distance_and_normal


@dataclass(frozen=True, eq=False)
class Contacts:
    """K body-fixed points that lie on the object's surface (or the floor) in the reference pair.

    A sphere of the body at distance d from the surface with outward normal n touches at x - d n: if that point is on
    the target's surface too and the sphere is outside, the target's surface faces the body from the same side.
    """

    joint: Tensor  # [K]
    offset: Tensor  # [K, 3] in the joint's frame [m]
    rest: Tensor  # [K] signed distance in the reference pair, about 0 [m]
    weight: Tensor  # [K], sums to at most 1; what is missing counts as missed, so that references compare
    on_floor: Tensor  # [K] bool: touches the floor rather than the object
    group: tuple[str, ...]  # [K] "support" (from below), "lean", "floor" or "arms"


def contact_energy(
    figure: Figure, contacts: Contacts, distance: SignedDistance, floor_height: float, *, scale: float = 0.05
) -> Tensor:
    """E_s = 1 - sum_k w_k + sum_k w_k e_k^2 / (e_k^2 + s^2), e_k the signed distance of contact k to the surface.

    -> [B] in [0, 1]; 0 when every kind of contact is there and met.

    The Geman-McClure function lets go of contacts that the target cannot offer: a stool has no back. `scale` s [m].
    """
    misses = contact_misses(figure, contacts, distance, floor_height)
    return 1.0 - contacts.weight.sum() + (contacts.weight * robust(misses, scale)).sum(-1)


def robust(residual: Tensor, scale: float) -> Tensor:
    """Geman-McClure: e^2 / (e^2 + s^2), from 0 to 1."""
    square = residual.square()
    return square / (square + scale * scale)


def contact_misses(figure: Figure, contacts: Contacts, distance: SignedDistance, floor_height: float) -> Tensor:
    """Signed distance of every contact point to what it should touch. -> [B, K] [m]."""
    points = figure.attached(contacts.joint, contacts.offset)
    return torch.where(contacts.on_floor, points[..., 1] - floor_height, distance.query(points) - contacts.rest)


def find_contacts(
    figure: Figure, body: BodyPoints, distance: SignedDistance, *, reach: float = 0.03
) -> tuple[Tensor, Tensor]:
    """Where the reference body touches the reference object: spheres within `reach` [m] of its surface.

    Returns the indices of the spheres [K] and the touching points [K, 3] (world).
    """
    points = figure.attached(body.joint, body.offset)[0].detach().requires_grad_(True)
    d = distance.query(points)
    (gradient,) = torch.autograd.grad(d.sum(), points)
    normal = torch.nn.functional.normalize(gradient, dim=-1)
    near = torch.nonzero((d - body.radius).abs() < reach)[:, 0]
    return near, (points - d[:, None] * normal)[near].detach()


def contact_pull(
    figure: Figure, contacts: Contacts, distance: SignedDistance, floor_height: float, *, scale: float = 0.05
) -> tuple[Tensor, Pull]:
    """E_s [B] and its pull; the stiffness is that of the reweighted least squares that Geman-McClure amounts to."""
    points = figure.attached(contacts.joint, contacts.offset)
    value, normal = distance_and_normal(distance, points)
    up = torch.zeros_like(normal)
    up[..., 1] = 1.0
    miss = torch.where(contacts.on_floor, points[..., 1] - floor_height, value - contacts.rest)
    normal = torch.where(contacts.on_floor[:, None], up, normal)
    firm = contacts.weight * 2 * scale**2 / (miss.square() + scale**2).square()
    energy = 1.0 - contacts.weight.sum() + (contacts.weight * robust(miss, scale)).sum(-1)
    return energy, Pull(contacts.joint, points, (firm * miss)[..., None] * normal, firm, normal)
