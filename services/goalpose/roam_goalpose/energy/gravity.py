"""E_g: pelvis, chest and head keep the reference's lean (beyond the paper).

Furniture stands upright in the world, so a sitter's tilt against gravity is part of the reference; the descriptors,
blind to gravity by design, let near-symmetric objects (a cube stool) pull the body over.
"""

from functools import cache

import torch
from roam_character.rotation import quat_inv, quat_rotate
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.rows import Bend, squares

UPRIGHT_JOINTS = ("hips", "upperChest", "head")
_UP = torch.tensor([0.0, 1.0, 0.0])


@cache
def upright_joints(skeleton: Skeleton) -> Tensor:
    """Pelvis, chest and head. -> [3]."""
    with torch.inference_mode(False):
        return torch.tensor(skeleton.indices(UPRIGHT_JOINTS))


def gravity_directions(figure: Figure) -> Tensor:
    """World up as seen by pelvis, chest and head: independent of yaw. -> [B, 3, 3]."""
    up = figure.positions.new_tensor([0.0, 1.0, 0.0])
    orientations = figure.orientations[:, upright_joints(figure.skeleton)]
    return quat_rotate(quat_inv(orientations), up.expand(*orientations.shape[:-1], 3))


def carried_up(figure: Figure, reference: Tensor) -> Tensor:
    """The reference's up directions [1 or B, 3, 3], carried by its joints, in the world. -> [B, 3, 3]."""
    return figure.directed(upright_joints(figure.skeleton), reference)


def gravity(carried: Tensor) -> Bend:
    """E_g = mean_k |g_k - g_k^ref|^2, about the squared tilt for small angles [rad^2], of `carried` up [B, 3, 3]."""
    return squares((carried - _UP.to(carried)).flatten(1), 1.0 / carried.shape[1])
