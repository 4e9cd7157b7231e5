"""Standardise, then normalise: the last step of a descriptor, in as few passes over memory as possible."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor


class _Direction(torch.autograd.Function):
    """`d = s / |s|` with `s = (numbers - mean) / deviation`; differentiable once, in `numbers` only.

    Written by hand because at 670 numbers per query the element-wise passes that autograd would make cost more than
    the decoder's matrix products.
    """

    @staticmethod
    def forward(ctx: Any, numbers: Tensor, mean: Tensor, scale: Tensor) -> Tensor:
        standard = (numbers - mean).mul_(scale)
        inverse = torch.linalg.vector_norm(standard, dim=-1, keepdim=True).clamp_(min=1e-12).reciprocal_()
        direction = standard.mul_(inverse)
        ctx.save_for_backward(direction, inverse, scale)
        return direction

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, None, None]:
        (grad,) = grads
        direction, inverse, scale = ctx.saved_tensors
        along = torch.einsum("...d,...d->...", grad, direction)[..., None]
        return torch.addcmul(grad, direction, along, value=-1).mul_(inverse).mul_(scale), None, None


def direction(numbers: Tensor, mean: Tensor, scale: Tensor) -> Tensor:
    """Unit vectors `[..., D]` along `(numbers - mean) * scale`."""
    result: Tensor = _Direction.apply(numbers, mean, scale)  # type: ignore[no-untyped-call]
    return result
