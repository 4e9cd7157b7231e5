"""Query point → invariant numbers → activations → occupancy (paper 3.1.1, Ω, and Eq. 3).

The numbers that enter are inner products and distances, hence invariant under rotation and translation of object and
query together. They come at three reaches: the global frame, and two soft averages over the anchors near the query.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

from roam_goalpose.field.config import FieldConfig
from roam_goalpose.field.latent import Latent

REACHES = (0.03, 0.10)
"""Initial reach [m] of the soft averages; learned from there."""


class Answer(NamedTuple):
    """What the heads say about a query."""

    logit: Tensor
    """`[B, Q]` occupancy logit."""
    distance: Tensor
    """`[B, Q]` signed distance, in units of 10 cm, saturating."""
    place: Tensor
    """`[B, Q, 3]` [m]: distance to the mirror plane, height over the seat, distance to the front of the middle."""


class Look(NamedTuple):
    """What a query sees of the object, kept for those who need its slope (`vjp.py`); H reaches, M anchors."""

    numbers: Tensor
    """`[B, Q, inputs]`."""
    x: Tensor
    """`[B, Q, 3]` queries from the centre [m]."""
    radius: Tensor
    """`[B, Q, 1]` their length."""
    distance: Tensor
    """`[B, Q, M]` from the anchors [m]."""
    weights: Tensor
    """`[B, H, Q, M]` of the anchors in the averages, the largest 1."""
    total: Tensor
    """`[B, H, Q, 1]` their sum."""
    soft: Tensor
    """`[B, H, Q, W]` averages of the anchors' features."""
    offset: Tensor
    """`[B, H, Q, 3]` from the averaged anchor [m]."""
    gap: Tensor
    """`[B, H, Q, 1]` its length."""


class Decoder(nn.Module):
    """Ω with all its activations exposed."""

    def __init__(self, config: FieldConfig) -> None:
        super().__init__()
        c = self.config = config
        self.log_reach = nn.Parameter(torch.log(torch.tensor(REACHES)))
        self.first = nn.Linear(c.inputs, c.hidden)
        self.inner = nn.ModuleList(nn.Linear(c.hidden, c.hidden) for _ in range(c.decoder_blocks))
        self.outer = nn.ModuleList(nn.Linear(c.hidden, c.hidden) for _ in range(c.decoder_blocks))
        self.heads = nn.Linear(c.hidden, 5)
        for layer in self.outer:
            nn.init.zeros_(layer.get_parameter("weight"))

    def inputs(self, latent: Latent, queries: Tensor) -> Tensor:
        """Invariant numbers `[B, Q, inputs]` of queries `[B, Q, 3]` [m, the cloud's frame]."""
        return self.look(latent, queries).numbers

    def look(self, latent: Latent, queries: Tensor) -> Look:
        """The same with what led to them."""
        c, x = self.config, queries - latent.center[:, None]
        squared = (x * x).sum(-1, keepdim=True)
        radius = torch.sqrt(squared + 1e-6)
        anchors = latent.anchors
        squares = (anchors * anchors).sum(-1)[:, None] + squared
        gaps = torch.baddbmm(squares, x, anchors.transpose(1, 2), alpha=-2)
        distance = torch.sqrt(gaps.clamp_min(0.0) + 1e-4)  # [B, Q, M], rounded off within a centimetre of an anchor
        reach = torch.exp(self.log_reach)[:, None, None]
        # One exponential serves the average and the soft minimum of the distances alike.
        scores = distance[:, None] * (-1 / reach)  # [B, heads, Q, M]
        highest = scores.detach().amax(-1, keepdim=True)
        weights = torch.exp(scores - highest)
        total = weights.sum(-1, keepdim=True)
        soft = (weights @ latent.local) / total
        own, flat, products, place = soft.split([c.local_scalars, 3 * c.local_vectors, c.local_vectors, 3], -1)
        along = (x[:, None, :, :, None] * flat.unflatten(-1, (3, c.local_vectors))).sum(-2) - products
        offset = x[:, None] - place
        gap = torch.sqrt((offset * offset).sum(-1, keepdim=True) + 1e-4)
        nearness = -reach * (highest + torch.log(total))
        near = torch.cat([nearness, gap, own, along], -1).transpose(1, 2).flatten(2)
        numbers = torch.cat([squared, radius, x @ latent.frame, near], -1)
        return Look(numbers, x, radius, distance, weights, total, soft, offset, gap)

    def activations(self, latent: Latent, queries: Tensor) -> list[Tensor]:
        """The inputs and every hidden state, in order: `[B, Q, inputs]`, then `[B, Q, hidden]` each."""
        numbers = self.inputs(latent, queries)
        return [numbers, *self.states(latent, numbers)[0]]

    def states(self, latent: Latent, numbers: Tensor) -> tuple[list[Tensor], list[Tensor]]:
        """Every hidden state, and what is between each and the next: `[B, Q, hidden]` each."""
        states, between = [object_wise(self.first, numbers) + latent.biases[:, :1]], []
        for k, (inner, outer) in enumerate(zip(self.inner, self.outer, strict=True)):
            hidden = object_wise(inner, torch.relu(states[-1])) + latent.biases[:, k + 1 : k + 2]
            between.append(torch.relu(hidden))
            states.append(states[-1] + object_wise(outer, between[-1]))
        return states, between

    def answer(self, latent: Latent, queries: Tensor) -> Answer:
        """What the object is like at the queries `[B, Q, 3]`."""
        out = self.heads(torch.relu(self.activations(latent, queries)[-1]))
        return Answer(out[..., 0], out[..., 1], out[..., 2:])


def object_wise(layer: nn.Module, x: Tensor) -> Tensor:
    """A linear layer on `[B, Q, inputs]`, a matrix product for every object.

    One product for all would round an object's numbers otherwise the more others there are.
    """
    weight, bias = layer.get_parameter("weight"), layer.get_parameter("bias")
    return torch.baddbmm(bias, x, weight.t().expand(len(x), -1, -1))
