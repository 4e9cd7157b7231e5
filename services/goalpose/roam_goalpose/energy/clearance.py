"""E_n: every part of the body is as far from the object as in the reference (beyond the paper).

The signed distance is a descriptor of one number that needs no training: it tells a seat with a back from one
without, the side of an armrest from the room in front of the knees. It keeps the learned descriptors honest on
objects unlike any that the field was trained on.
"""

from torch import Tensor

from roam_goalpose.energy.rows import Bend, robust

FAR = 0.4  # [m] beyond this all distances count as equal
SCALE = 0.1  # [m] of the Geman-McClure function: beyond it a difference is a difference


def clearance(distance: Tensor, reference: Tensor) -> Bend:
    """E_n = mean_p e_p^2 / (e_p^2 + s^2), e_p the difference in clearance: in [0, 1].

    `distance` [B, P] of the body's spheres from the object [m], `reference` [1 or B, P] the same in the reference
    pair, at most `FAR`.
    """
    found = robust(distance.clamp(max=FAR) - reference, SCALE, 1.0 / distance.shape[-1])
    near = distance < FAR
    return Bend(found.energy, found.slope * near, found.stiffness * near)
