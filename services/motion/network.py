"""l-NSM (paper 3.2): a frame encoder, a goal encoder, and a decoder of experts mixed by a gating network.

Mixing K weight matrices per sample is algebraically one product over (mixture x input): `[B, K n] @ [K n, m]`, which in
batches is 10-40 times cheaper than building B weight matrices.
"""

from dataclasses import asdict, dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import elu


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes. The paper has 10 experts of width 512 (13.7 M parameters); these are what two CPU cores train in an
    hour."""

    frame: int  # numbers that describe the character
    goal: int  # numbers that describe the goal
    gating: int  # phase x labels x distance and angle
    output: int
    experts: int = 8
    encoding: int = 256
    hidden: int = 256
    gate_hidden: int = 64
    dropout: float = 0.0  # on the encoders' inputs; the paper's 0.3 costs accuracy when targets are per-frame changes

    def as_dict(self) -> dict[str, float]:
        """Plain numbers for the weights' manifest."""
        return asdict(self)


class Experts(nn.Module):
    """A linear layer whose weights are mixed per sample: y = sum_k a_k (W_k x + b_k)."""

    def __init__(self, experts: int, inputs: int, outputs: int) -> None:
        super().__init__()
        bound = (6.0 / (inputs + outputs)) ** 0.5
        # Experts start from one common matrix plus differences, so that a mixture starts at the scale of a single
        # layer.
        common = torch.empty(1, inputs, outputs).uniform_(-bound, bound)
        apart = torch.empty(experts, inputs, outputs).uniform_(-bound, bound)
        self.weight = nn.Parameter(common + 0.5 * apart)
        self.bias = nn.Parameter(torch.zeros(experts, outputs))

    def forward(self, x: Tensor, mixture: Tensor) -> Tensor:
        """`x` [B, n], `mixture` [B, K] -> [B, m]."""
        spread = (mixture.unsqueeze(2) * x.unsqueeze(1)).flatten(1)  # [B, K n]
        return torch.addmm(mixture @ self.bias, spread, self.weight.flatten(0, 1))


class MotionNetwork(nn.Module):
    """Character and goal in, next frame out; inputs raw, outputs in normalised units (see `Normaliser`)."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        self.frame_encoder = _encoder(config.frame, config.encoding)
        self.goal_encoder = _encoder(config.goal, config.encoding)
        self.gate = nn.Sequential(
            nn.Linear(config.gating, config.gate_hidden),
            nn.ELU(),
            nn.Linear(config.gate_hidden, config.gate_hidden),
            nn.ELU(),
            nn.Linear(config.gate_hidden, config.experts),
            nn.Softmax(-1),
        )
        self.first = Experts(config.experts, 2 * config.encoding, config.hidden)
        self.second = Experts(config.experts, config.hidden, config.hidden)
        self.last = Experts(config.experts, config.hidden, config.output)
        self.last.weight.data *= 0.1  # start near "no change"
        self.dropout = nn.Dropout(config.dropout)

    def forward(self, frame: Tensor, goal: Tensor, gating: Tensor) -> Tensor:
        """Normalised `frame` [B, F], `goal` [B, G], `gating` [B, S] -> normalised output [B, O]."""
        mixture = self.gate(gating)
        x = torch.cat([self.frame_encoder(self.dropout(frame)), self.goal_encoder(self.dropout(goal))], -1)
        x = elu(self.first(x, mixture))
        x = elu(self.second(x, mixture))
        out: Tensor = self.last(x, mixture)
        return out


def _encoder(inputs: int, width: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inputs, width), nn.ELU(), nn.Linear(width, width), nn.ELU())


class Normaliser(nn.Module):
    """Column means and deviations of inputs and outputs, saved with the weights."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        for name in ("frame", "goal", "gating", "output"):
            self.register_buffer(f"{name}_mean", torch.zeros(int(getattr(config, name))))
            self.register_buffer(f"{name}_std", torch.ones(int(getattr(config, name))))

    def apply_to(self, name: str, x: Tensor) -> Tensor:
        """Raw to normalised; clipped at 8 deviations so that one odd input cannot run away with the network."""
        mean, std = self.get_buffer(f"{name}_mean"), self.get_buffer(f"{name}_std")
        return ((x - mean) / std).clamp(-8.0, 8.0)

    def undo(self, name: str, x: Tensor) -> Tensor:
        """Normalised to raw."""
        return x * self.get_buffer(f"{name}_std") + self.get_buffer(f"{name}_mean")
