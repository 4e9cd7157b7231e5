"""The descriptor field (paper 3.1.1): a shape's surface points in, a descriptor for every point of space out."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import torch
from safetensors import safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from roam_goalpose.field.config import FieldConfig
from roam_goalpose.field.decoder import Answer, Decoder
from roam_goalpose.field.direction import direction
from roam_goalpose.field.encoder import Encoder
from roam_goalpose.field.latent import Latent
from roam_goalpose.field.vjp import Linearization


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
