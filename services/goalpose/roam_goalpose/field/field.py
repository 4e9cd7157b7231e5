"""The descriptor field (paper 3.1.1): a shape's surface points in, a descriptor for every point of space out."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from safetensors import safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from roam_goalpose.field.config import FieldConfig
from roam_goalpose.field.decoder import Answer, Decoder
from roam_goalpose.field.encoder import Encoder
from roam_goalpose.field.latent import Latent
from roam_goalpose.field.vjp import Linearization


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


class Field(nn.Module):
    """Encoder Φ and decoder Ω. After `load` the weights are frozen; gradients flow to the query points only."""

    mean: Tensor
    deviation: Tensor

    def __init__(self, config: FieldConfig | None = None) -> None:
        super().__init__()
        self.config = config or FieldConfig()
        self.encoder = Encoder(self.config)
        self.decoder = Decoder(self.config)
        self.register_buffer("mean", torch.zeros(self.config.descriptor))
        self.register_buffer("deviation", torch.ones(self.config.descriptor))

    @staticmethod
    def load(path: str | Path) -> Field:
        """Reads weights written by `save`; frozen, in evaluation mode.

        Raises:
            FileNotFoundError: there is no such file.
            KeyError: the file is no descriptor field.
        """
        with safe_open(str(path), framework="pt") as file:
            config = FieldConfig(**json.loads(file.metadata()["config"]))
            weights = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        field = Field(config)
        field.load_state_dict(weights)
        return field.requires_grad_(False).eval()

    def save(self, path: str | Path) -> None:
        """Writes weights and sizes as safetensors."""
        weights = {name: value.detach().contiguous() for name, value in self.state_dict().items()}
        save_file(weights, str(path), metadata={"config": json.dumps(asdict(self.config), sort_keys=True)})

    @torch.no_grad()
    def encode(self, points: Tensor) -> Latent:
        """Codes of point clouds `[B, N, 3]` [m, any placement]; N should be 500-2,000 points, uniform by area."""
        order = torch.randperm(points.shape[1], generator=torch.Generator().manual_seed(0))
        latent: Latent = self.encoder(points[:, order])
        return latent

    def descriptor(self, latent: Latent, queries: Tensor) -> Tensor:
        """Unit descriptors `[B, Q, D]` of queries `[B, Q, 3]` [m, the cloud's frame]: Eq. 3.

        Every number is measured in its own deviation over ordinary queries before the concatenation is normalised, so
        that no layer outweighs the others.
        """
        numbers = torch.cat(self.decoder.activations(latent, queries), -1)
        return direction(numbers, self.mean, 1 / self.deviation)

    @torch.no_grad()
    def linearize(self, latent: Latent, queries: Tensor) -> Linearization:
        """`descriptor` and its slopes in the queries `[B, Q, 3]`, without autograd."""
        return Linearization.of(self.decoder, latent, queries, mean=self.mean, scale=1 / self.deviation)

    def occupancy(self, latent: Latent, queries: Tensor) -> Tensor:
        """Occupancy logits `[B, Q]` of queries `[B, Q, 3]`: Eq. 2 before the sigmoid."""
        return self.answer(latent, queries).logit

    def answer(self, latent: Latent, queries: Tensor) -> Answer:
        """Occupancy, distance and place on the object of queries `[B, Q, 3]`."""
        return self.decoder.answer(latent, queries)
