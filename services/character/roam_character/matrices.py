"""Rotations as matrices, in torch: for code that keeps one world orientation per joint, columns = images of +X, +Y, +Z.

The same rotations as quaternions are in `roam_character.rotation`. Every function is a few calls.
"""

import torch
from torch import Tensor

from roam_character.tensors.elementary import sinc

_IDENTITY = torch.eye(3)
# Puts the components of a vector, or their negatives, where the matrix that crosses with it has them.
_SKEW = torch.tensor([[0.0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]])


def unit(vectors: Tensor) -> Tensor:
    """Vectors scaled to length 1; those shorter than a micrometre stay short. [..., N] -> [..., N]."""
    return vectors / torch.linalg.vector_norm(vectors, dim=-1, keepdim=True).clamp_min(1e-6)


def matrix_to_6d(matrices: Tensor) -> Tensor:
    """Forward axis (image of +Z) then up axis (image of +Y). [..., 3, 3] -> [..., 6]."""
    return torch.cat([matrices[..., 2], matrices[..., 1]], -1)


def matrix_from_6d(axes: Tensor) -> Tensor:
    """The rotation with a forward and an up axis, orthonormalised: forward kept, up made square. [..., 6] ->
    [..., 3, 3]."""
    z = unit(axes[..., :3])
    x = unit(torch.linalg.cross(axes[..., 3:], z, dim=-1))
    return torch.stack([x, torch.linalg.cross(z, x, dim=-1), z], -1)


def matrix_between(u: Tensor, v: Tensor) -> Tensor:
    """The smallest rotation that turns direction `u` into `v` (not for opposite ones). [..., 3] -> [..., 3, 3]."""
    u, v = unit(u), unit(v)
    skew, cosine = _skew(torch.linalg.cross(u, v, dim=-1)), (u * v).sum(-1)
    return _IDENTITY + skew + skew @ skew / (1 + cosine).clamp_min(1e-3)[..., None, None]


def matrix_from_rotvec(vectors: Tensor) -> Tensor:
    """The rotation about each vector by its length [rad] (Rodrigues' formula). [..., 3] -> [..., 3, 3]."""
    angle = torch.linalg.vector_norm(vectors, dim=-1)[..., None, None] / torch.pi  # [half turns]
    whole, half = sinc(torch.stack([angle, angle / 2])).unbind()
    skew = _skew(vectors)
    return _IDENTITY + skew * whole + skew @ skew * (0.5 * half.square())


def _skew(vectors: Tensor) -> Tensor:
    """The matrix that crosses with a vector. [..., 3] -> [..., 3, 3]."""
    return (vectors @ _SKEW).unflatten(-1, (3, 3))
