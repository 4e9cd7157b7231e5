"""Rotations of many joints, in few operations: a solver's batches are small, and each costs microseconds however little
it does. The same numbers as `character.rotation`, whose functions are for numpy too."""

import torch
from torch import Tensor

_TINY = 1e-16  # keeps lengths off 0
_TURN = torch.tensor([[3, 2, 1, 0], [2, 3, 0, 1], [1, 0, 3, 2], [0, 1, 2, 3]]).flatten()
_SIGN = torch.tensor([[1.0, -1.0, 1.0, 1.0], [1.0, 1.0, -1.0, 1.0], [-1.0, 1.0, 1.0, 1.0], [-1.0, -1.0, -1.0, 1.0]])
_CONJUGATE = torch.tensor([-1.0, -1.0, -1.0, 1.0])
_IDENTITY = torch.eye(3)


def _squares() -> Tensor:
    """How a rotation matrix less the identity is made of the products q_a q_b: [16, 9]."""
    parts = torch.zeros(3, 3, 4, 4)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        parts[i, i, j, j] = parts[i, i, k, k] = -2.0
        parts[i, j, i, j] = parts[j, i, i, j] = 2.0
        parts[i, j, k, 3], parts[j, i, k, 3] = -2.0, 2.0
    return parts.reshape(9, 16).T.contiguous()


_SQUARES = _squares()


def product(a: Tensor, b: Tensor) -> Tensor:
    """Hamilton products of quaternions [..., 4], as small matrices made of `a` times `b`."""
    matrix = a.index_select(-1, _TURN).unflatten(-1, (4, 4)) * _SIGN.to(a)
    return (matrix * b[..., None, :]).sum(-1)


def inverse(q: Tensor) -> Tensor:
    """Of unit quaternions [..., 4]."""
    return q * _CONJUGATE.to(q)


def matrices(q: Tensor) -> Tensor:
    """Unit quaternions [..., 4] -> rotation matrices [..., 3, 3]."""
    products = (q[..., :, None] * q[..., None, :]).flatten(-2)
    return (products @ _SQUARES.to(q)).unflatten(-1, (3, 3)) + _IDENTITY.to(q)


def from_rotvec(v: Tensor) -> Tensor:
    """Rotation vectors [..., 3] [rad] -> quaternions [..., 4]."""
    angle = _length(v)
    half = angle / 2
    return torch.cat([v * (half.sin() / angle), half.cos()], dim=-1)


def to_rotvec(q: Tensor) -> Tensor:
    """Quaternions [..., 4] -> rotation vectors [..., 3] [rad], the shorter way round."""
    q = torch.where(q[..., 3:] < 0, -q, q)
    axis = q[..., :3]
    sine = _length(axis)
    return axis * (2 * torch.atan2(sine, q[..., 3:]) / sine)


def _length(v: Tensor) -> Tensor:
    return ((v * v).sum(-1, keepdim=True) + _TINY).sqrt()
