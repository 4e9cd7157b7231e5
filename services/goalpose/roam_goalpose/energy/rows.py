"""How an energy bends: first and second order around the present pose, without autograd through the skeleton.

Every term is a function of scalars of the pose: how far a sphere is from the object, how far a joint is from where it
should be. `Bend` is the term as a function of those scalars, `Rows` adds how the scalars move with the unknowns
(`chain`); both together give gradient and Gauss-Newton matrix.
"""

from typing import NamedTuple

import torch
from torch import Tensor


class Bend(NamedTuple):
    """One term as a function of K scalars of every pose."""

    energy: Tensor  # [B]
    slope: Tensor  # [B, K] dE/dscalar
    stiffness: Tensor  # [B, K] second derivative or a positive stand-in, >= 0


class Rows(NamedTuple):
    """R scalars of every pose: how they move, and how the weighted energy bends in them."""

    motion: Tensor  # [B, R, N] d scalar / d unknowns
    slope: Tensor  # [B, R]
    stiffness: Tensor  # [B, R]


def squares(residual: Tensor, weight: float | Tensor = 1.0) -> Bend:
    """sum_k w r_k^2 of residuals [B, K]; `weight` broadcasts."""
    scaled = weight * residual
    return Bend((scaled * residual).sum(-1), 2 * scaled, torch.zeros_like(residual) + 2 * weight)


def robust(residual: Tensor, scale: float, weight: float | Tensor) -> Bend:
    """sum_k w e_k^2 / (e_k^2 + s^2), Geman-McClure: from 0 to w for each; `scale` s in the residual's unit.

    The stiffness is that of the reweighted least squares that the function amounts to.
    """
    square = residual.square()
    rounded = square + scale * scale
    firm = weight * (2 * scale * scale) / rounded.square()
    return Bend((weight * square / rounded).sum(-1), firm * residual, firm)


def weighed(bend: Bend, weight: float) -> Bend:
    """The same term `weight` times."""
    return Bend(*(weight * part for part in bend))


def rows_of(bend: Bend, motion: Tensor) -> Rows:
    """A term whose scalars move by `motion` [B, K, N]."""
    return Rows(motion, bend.slope, bend.stiffness)


def rows_concat(parts: list[Rows]) -> Rows:
    """The rows of several terms below each other."""
    return Rows(*(torch.cat(column, dim=1) for column in zip(*parts, strict=True)))
