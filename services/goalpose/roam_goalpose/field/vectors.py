"""Vector neurons: features that are 3D vectors and turn with the object.

A vector feature is `[B, 3, N, C]`: the space axis comes before the points, so that a linear layer is one matrix
product over `[B * 3 * N, C]` and no per-edge tensor is ever made. Mixing channels commutes with any rotation of the
space axis; lengths and inner products of vectors are invariant under it (Deng et al., Vector Neurons, 2021).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn


def lengths(vectors: Tensor) -> Tensor:
    """Invariant lengths `[B, N, C]` of vector features `[B, 3, N, C]`."""
    return torch.sqrt((vectors * vectors).sum(1) + 1e-8)


class VectorBlock(nn.Module):
    """One residual step on vectors `[B, 3, N, C]` and the invariant scalars `[B, N, F]` that travel with them.

    Each point sees itself, the smoothed features of its neighbourhood and the mean of the object. Vectors are mixed
    linearly without bias and scaled by gates computed from invariants: a non-linearity that needs fewer passes over
    the vectors than projecting them on learned directions.
    """

    def __init__(self, channels: int, scalars: int, shared: int) -> None:
        super().__init__()
        self.share_vectors = nn.Linear(channels, shared, bias=False)
        self.share_scalars = nn.Linear(scalars, shared)
        self.mix = nn.Linear(channels + shared, channels, bias=False)
        self.mix_mean = nn.Linear(channels, channels, bias=False)
        self.scalar_in = nn.Linear(scalars + shared + channels, scalars)
        self.scalar_mean = nn.Linear(scalars, scalars)
        self.scalar_out = nn.Linear(scalars, scalars)
        self.gate = nn.Linear(scalars, channels)
        self.out = nn.Linear(channels, channels, bias=False)

    def forward(self, vectors: Tensor, scalars: Tensor, smoothing: Tensor) -> tuple[Tensor, Tensor]:
        """`smoothing` `[B, N, N]` averages over neighbourhoods (rows sum to one)."""
        near_vectors = smoothing[:, None] @ self.share_vectors(vectors)
        near_scalars = smoothing @ self.share_scalars(scalars)
        mixed = self.mix(torch.cat([vectors, near_vectors], -1)) + self.mix_mean(vectors.mean(2, keepdim=True))
        inner = torch.cat([scalars, near_scalars, lengths(mixed)], -1)
        hidden = torch.relu(self.scalar_in(inner) + self.scalar_mean(scalars.mean(1, keepdim=True)))
        gated = mixed * torch.sigmoid(self.gate(hidden))[:, None]
        return vectors + self.out(gated), scalars + self.scalar_out(hidden)
