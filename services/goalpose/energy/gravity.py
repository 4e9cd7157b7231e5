"""E_g: pelvis, chest and head keep the reference's lean (beyond the paper).

Furniture stands upright in the world, so a sitter's tilt against gravity is part of the reference; the descriptors,
blind to gravity by design, let near-symmetric objects (a cube stool) pull the body over.
"""

from character.rotation import quat_inv, quat_rotate
from torch import Tensor

from goalpose.energy.figure import Figure

UPRIGHT_JOINTS = ("hips", "upperChest", "head")


def gravity_directions(figure: Figure) -> Tensor:
    """World up as seen by pelvis, chest and head: independent of yaw. -> [B, 3, 3]."""
    joints = figure.skeleton.indices(UPRIGHT_JOINTS)
    up = figure.positions.new_tensor([0.0, 1.0, 0.0])
    orientations = figure.orientations[:, joints]
    return quat_rotate(quat_inv(orientations), up.expand(*orientations.shape[:-1], 3))


def gravity_energy(figure: Figure, reference: Tensor) -> Tensor:
    """E_g = mean_k |g_k - g_k^ref|^2, about the squared tilt for small angles. `reference` [3, 3] -> [B] [rad^2]."""
    return (gravity_directions(figure) - reference).square().sum(-1).mean(-1)
