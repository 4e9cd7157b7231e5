"""E_n: every part of the body is as far from the object as in the reference (beyond the paper).

The signed distance is a descriptor of one number that needs no training: it tells a seat with a back from one
without, the side of an armrest from the room in front of the knees. It keeps the learned descriptors honest on
objects unlike any that the field was trained on.
"""

from torch import Tensor

from goalpose.energy.contact import robust
from goalpose.energy.figure import Figure
from goalpose.energy.penetration import BodyPoints
from goalpose.energy.pull import Pull, SignedDistance, distance_and_normal

FAR = 0.4  # [m] beyond this all distances count as equal
SCALE = 0.1  # [m] of the Geman-McClure function: beyond it a difference is a difference


def clearances(figure: Figure, body: BodyPoints, distance: SignedDistance) -> Tensor:
    """Signed distance of every sphere's centre, at most `FAR`. -> [B, P] [m]."""
    return distance.query(figure.attached(body.joint, body.offset)).clamp(max=FAR)


def clearance_energy(figure: Figure, body: BodyPoints, distance: SignedDistance, reference: Tensor) -> Tensor:
    """E_n = mean_p e_p^2 / (e_p^2 + s^2), e_p the difference in clearance. `reference` [P] [m] -> [B] in [0, 1]."""
    return robust(clearances(figure, body, distance) - reference, SCALE).mean(-1)


def clearance_pull(
    figure: Figure, body: BodyPoints, distance: SignedDistance, reference: Tensor
) -> tuple[Tensor, Pull]:
    """E_n [B] and its pull."""
    points = figure.attached(body.joint, body.offset)
    value, normal = distance_and_normal(distance, points)
    difference = value.clamp(max=FAR) - reference
    firm = 2 * SCALE**2 / (difference.square() + SCALE**2).square() / len(body.joint) * (value < FAR)
    pull = Pull(body.joint, points, (firm * difference)[..., None] * normal, firm, normal)
    return robust(difference, SCALE).mean(-1), pull
