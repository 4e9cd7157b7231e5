"""E_s: touch the object where the reference touches it, and the floor with the soles (beyond the paper)."""

from dataclasses import dataclass

import torch
from torch import Tensor

from roam_goalpose.energy.distance import SignedDistance
from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.penetration import BodyPoints
from roam_goalpose.energy.rows import Bend, robust

SUPPORT, LEAN, FLOOR, ARMS = GROUPS = range(4)  # from below; from behind or the side; the soles; the arms
SCALE = 0.05  # [m] of the Geman-McClure function: a contact missed by more is missed
REACH = 0.03  # [m] between surface and body at which they touch


@dataclass(frozen=True, eq=False)
class Contacts:
    """K body-fixed points of R references that lie on the object's surface (or the floor) in the reference pair.

    A sphere of the body at distance d from the surface with outward normal n touches at x - d n: if that point is on
    the target's surface too and the sphere is outside, the target's surface faces the body from the same side.
    """

    joint: Tensor  # [R, K]
    offset: Tensor  # [R, K, 3] in the joint's frame [m]
    rest: Tensor  # [R, K] signed distance in the reference pair, about 0 [m]
    weight: Tensor  # [R, K], sums to at most 1; what is missing counts as missed, so that references compare
    group: Tensor  # [R, K], one of GROUPS

    @property
    def on_floor(self) -> Tensor:
        """Which contacts are with the floor rather than the object. -> [R, K]."""
        return self.group == FLOOR

    def __getitem__(self, index: Tensor | slice) -> "Contacts":
        return Contacts(self.joint[index], self.offset[index], self.rest[index], self.weight[index], self.group[index])

    def on(self, figure: Figure) -> Tensor:
        """The contact points of every pose [B, K, 3] [m]."""
        count = len(figure)
        return figure.attached(self.joint.expand(count, -1), self.offset.expand(count, -1, -1))

    def misses(self, height: Tensor, distance: Tensor) -> Tensor:
        """What is between the contact points and what they should touch, from their `height` above the floor and
        their `distance` from the object, both [B, K] [m]. -> [B, K] [m]."""
        return torch.where(self.on_floor, height, distance - self.rest)


def contacts_stack(parts: list[Contacts]) -> Contacts:
    """The contacts of several references, filled up to the same number with some that weigh nothing."""
    most = max(part.joint.shape[1] for part in parts)

    def filled(values: list[Tensor]) -> Tensor:
        return torch.cat([torch.cat([v, v[:, :1].expand(-1, most - v.shape[1], *v.shape[2:])], 1) for v in values])

    weights = [torch.nn.functional.pad(part.weight, (0, most - part.weight.shape[1])) for part in parts]
    return Contacts(
        filled([part.joint for part in parts]),
        filled([part.offset for part in parts]),
        filled([part.rest for part in parts]),
        torch.cat(weights),
        filled([part.group for part in parts]),
    )


def contact(misses: Tensor, weight: Tensor) -> Bend:
    """E_s = 1 - sum_k w_k + sum_k w_k e_k^2 / (e_k^2 + s^2) in [0, 1]; 0 when every kind of contact is there and met.

    `misses` e [B, K] [m], `weight` w [1 or B, K]. The Geman-McClure function lets go of contacts that the target
    cannot offer: a stool has no back.
    """
    found = robust(misses, SCALE, weight)
    return Bend(1.0 - weight.sum(-1) + found.energy, found.slope, found.stiffness)


def find_contacts(figure: Figure, body: BodyPoints, distance: SignedDistance) -> tuple[Tensor, Tensor, Tensor]:
    """Where the reference body touches the reference object: spheres within `REACH` of its surface.

    Returns the indices of the spheres [K], the outward normals there [K, 3], and the distances of their centres [K].
    """
    value, gradient = distance.tangent(body.on(figure)[0])
    near = torch.nonzero((value - body.radius).abs() < REACH)[:, 0]
    return near, torch.nn.functional.normalize(gradient[near], dim=-1), value[near]
