"""How points fixed to the skeleton move with its degrees of freedom: closed-form Jacobians.

The unknowns are root translation and one local rotation vector per joint, R_k exp(v_k): N = 3 + 3 J numbers. A point
x on joint j moves with v_k of every joint k from the root to j by (O_k v_k) x (x - o_k).
"""

from functools import cache

import torch
from character.rotation import quat_to_matrix
from character.skeleton import Skeleton
from torch import Tensor

from goalpose.energy.figure import Figure


@cache
def carriers(skeleton: Skeleton) -> Tensor:
    """Which joints carry which: [J, J], 1 at (j, k) when k is j or above it."""
    above = torch.eye(skeleton.joint_count)
    for j, parent in enumerate(skeleton.parents):
        if parent >= 0:
            above[j] += above[parent]
    return above


def point_motion(figure: Figure, joint: Tensor, points: Tensor) -> Tensor:
    """dx/d(unknowns) of points [B, P, 3] on joints [P]. -> [B, P, 3, N]."""
    batch, count, _ = points.shape
    arm = (points[:, :, None] - figure.positions[:, None]) * carriers(figure.skeleton)[joint][None, :, :, None]
    axes = quat_to_matrix(figure.orientations)  # [B, J, 3, 3], columns: local axes in the world
    turn = torch.linalg.cross(axes.transpose(-1, -2)[:, None], arm[:, :, :, None], dim=-1)  # [B, P, J, axis, xyz]
    turn = turn.reshape(batch, count, -1, 3).transpose(-1, -2)
    shift = torch.eye(3).expand(batch, count, 3, 3)
    return torch.cat([shift, turn], dim=-1)
