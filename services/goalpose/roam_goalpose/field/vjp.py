"""Vector-Jacobian products of descriptors in their query points: the decoder backwards, in closed form.

Autograd does the same at twice the price for the few hundred queries of one step: it builds a graph of a hundred nodes
to walk it once. Here every line undoes one of `Decoder.look`, `Decoder.states` or `direction`, from the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from roam_goalpose.field.decoder import Decoder, Look
from roam_goalpose.field.latent import Latent


@dataclass(frozen=True, eq=False)
class Linearization:
    """Descriptors at query points, and what their slopes are made of."""

    decoder: Decoder
    latent: Latent
    look: Look
    states: list[Tensor]  # [B, Q, hidden] each
    between: list[Tensor]  # [B, Q, hidden] each
    scale: Tensor  # [D] of every number in a descriptor
    inverse: Tensor  # [B, Q, 1] of the length before it became a unit vector
    descriptors: Tensor  # [B, Q, D]

    @classmethod
    def of(cls, decoder: Decoder, latent: Latent, queries: Tensor, *, mean: Tensor, scale: Tensor) -> Linearization:
        """At queries `[B, Q, 3]` [m]; `mean` and `scale` `[D]` as for `direction`."""
        look = decoder.look(latent, queries)
        states, between = decoder.states(latent, look.numbers)
        standard = torch.cat([look.numbers, *states], -1).sub_(mean).mul_(scale)
        inverse = torch.linalg.vector_norm(standard, dim=-1, keepdim=True).clamp_(min=1e-12).reciprocal_()
        return cls(decoder, latent, look, states, between, scale, inverse, standard.mul_(inverse))

    def vjp(self, cotangent: Tensor) -> Tensor:
        """Vector-Jacobian product: from something's slope in the descriptors `[B, Q, D]` to that in the queries
        `[B, Q, 3]`."""
        slope = cotangent
        along = (slope * self.descriptors).sum(-1, keepdim=True)
        slope = torch.addcmul(slope, self.descriptors, along, value=-1).mul_(self.inverse).mul_(self.scale)
        config = self.decoder.config
        numbers, *states = slope.split([config.inputs, *[config.hidden] * len(self.states)], -1)
        return self._through_look(numbers + self._through_states(states))

    def _through_states(self, slopes: Sequence[Tensor]) -> Tensor:
        """Slopes in all hidden states `[B, Q, hidden]` -> in the numbers before them `[B, Q, inputs]`."""
        *earlier, slope = slopes
        for k in reversed(range(len(earlier))):
            hidden = _back(slope, self.decoder.outer[k]).mul_(self.between[k] > 0)
            slope = slope + earlier[k] + _back(hidden, self.decoder.inner[k]).mul_(self.states[k] > 0)
        return _back(slope, self.decoder.first)

    def _through_look(self, slope: Tensor) -> Tensor:
        """Slopes in the numbers `[B, Q, inputs]` -> in the queries `[B, Q, 3]`."""
        c, look, latent = self.decoder.config, self.look, self.latent
        squared, radius, framed, near = slope.split([1, 1, c.frame, c.inputs - 2 - c.frame], -1)
        direct = (2 * squared + radius / look.radius) * look.x + framed @ latent.frame.transpose(1, 2)
        heads = near.unflatten(-1, (c.heads, -1)).transpose(1, 2)  # [B, H, Q, …]
        nearness, gap, own, along = heads.split([1, 1, c.local_scalars, c.local_vectors], -1)
        offset = look.offset * (gap / look.gap)
        flat = look.soft[..., c.local_scalars : c.local_scalars + 3 * c.local_vectors].unflatten(-1, (3, -1))
        direct = direct + ((flat @ along[..., None])[..., 0] + offset).sum(1)
        products = (look.x[:, None, :, :, None] * along[..., None, :]).flatten(-2)
        soft = torch.cat([own, products, -along, -offset], -1)
        return direct + self._through_averages(nearness, soft)

    def _through_averages(self, nearness: Tensor, soft: Tensor) -> Tensor:
        """Slopes in the soft minima `[B, H, Q, 1]` and the averages `[B, H, Q, W]` -> in the queries `[B, Q, 3]`."""
        look, latent, reach = self.look, self.latent, torch.exp(self.decoder.log_reach)[:, None, None]
        middle = (soft * look.soft).sum(-1, keepdim=True) + reach * nearness
        scores = (soft @ latent.local.transpose(-1, -2) - middle) * (look.weights / (look.total * -reach))
        gaps = scores.sum(1) / look.distance  # [B, Q, M], twice the slope in the squared distances
        return look.x * gaps.sum(-1, keepdim=True) - gaps @ latent.anchors


def _back(slope: Tensor, layer: nn.Module) -> Tensor:
    """Slopes behind a linear layer `[B, Q, outputs]` -> before it `[B, Q, inputs]`, object by object."""
    return torch.bmm(slope, layer.get_parameter("weight").expand(len(slope), -1, -1))
