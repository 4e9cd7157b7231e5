"""l-NSM (paper 3.2): a frame encoder, a goal encoder, and a decoder of experts mixed by a gating network.

Mixing K weight matrices per sample is algebraically one product over (mixture x input): `[B, K n] @ [K n, m]`, which in
batches is 10-40 times cheaper than building B weight matrices.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import elu

from roam_motion.models.lnsm.config import NetworkConfig


class Experts(nn.Module):
    """The weights of a linear layer that is mixed per sample: y = sum_k a_k (W_k x + b_k)."""

    def __init__(self, experts: int, inputs: int, outputs: int) -> None:
        super().__init__()
        bound = (6.0 / (inputs + outputs)) ** 0.5
        # Experts start from one common matrix plus differences, so that a mixture starts at the scale of a single
        # layer.
        common = torch.empty(1, inputs, outputs).uniform_(-bound, bound)
        apart = torch.empty(experts, inputs, outputs).uniform_(-bound, bound)
        self.weight = nn.Parameter(common + 0.5 * apart)
        self.bias = nn.Parameter(torch.zeros(experts, outputs))


Layers = tuple[tuple[Tensor, Tensor], ...]  # matrix [n, m] and bias [m]; of experts [K n, m] and [K, m]


@dataclass(frozen=True)
class Weights:
    """A network's numbers, matrices with a row for every input."""

    frame: Layers
    goal: Layers
    gate: Layers
    experts: Layers

    def contiguous(self) -> "Weights":
        """The same, every row in one piece: twice as quick for the few rows of a frame."""
        return Weights(*(tuple((w.detach().contiguous(), b.detach()) for w, b in part) for part in vars(self).values()))


def answer(weights: Weights, frame: Tensor, goal: Tensor, gating: Tensor) -> Tensor:
    """Normalised `frame` [B, F], `goal` [B, G], `gating` [B, S] -> normalised output [B, O]."""
    *hidden, (matrix, bias) = weights.gate
    mixture = torch.addmm(bias, _encoded(gating, hidden), matrix).softmax(-1)  # [B, K]
    x = torch.cat([_encoded(frame, weights.frame), _encoded(goal, weights.goal)], -1)
    first, second, last = weights.experts
    return _mixed(elu(_mixed(elu(_mixed(x, mixture, *first)), mixture, *second)), mixture, *last)


def _encoded(x: Tensor, layers: Iterable[tuple[Tensor, Tensor]]) -> Tensor:
    for matrix, bias in layers:
        x = elu(torch.addmm(bias, x, matrix))
    return x


def _mixed(x: Tensor, mixture: Tensor, matrix: Tensor, bias: Tensor) -> Tensor:
    """`x` [B, n], `mixture` [B, K] -> [B, m]."""
    spread = (mixture.unsqueeze(2) * x.unsqueeze(1)).flatten(1)  # [B, K n]
    return torch.addmm(mixture @ bias, spread, matrix)


class MotionNetwork(nn.Module):
    """Character and goal in, next frame out; inputs and outputs in normalised units (see `Normaliser`)."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        parts = config.parts
        self.frame_encoder = _encoder(config.frame, config.encoding) if parts.frame_encoder else nn.Sequential()
        self.goal_encoder = _encoder(config.goal, config.encoding) if parts.goal_encoder else nn.Sequential()
        self.gate = nn.Sequential(
            nn.Linear(config.gating, config.gate_hidden),
            nn.ELU(),
            nn.Linear(config.gate_hidden, config.gate_hidden),
            nn.ELU(),
            nn.Linear(config.gate_hidden, config.experts),
            nn.Softmax(-1),
        )
        encoded = config.encoding if parts.frame_encoder else config.frame
        encoded += config.encoding if parts.goal_encoder else config.goal
        self.first = Experts(config.experts, encoded, config.hidden)
        self.second = Experts(config.experts, config.hidden, config.hidden)
        self.last = Experts(config.experts, config.hidden, config.output)
        self.last.weight.data *= 0.1  # start near "no change"
        self.dropout = nn.Dropout(config.dropout)

    def weights(self) -> Weights:
        """Views of the parameters."""
        experts = tuple((part.weight.flatten(0, 1), part.bias) for part in (self.first, self.second, self.last))
        return Weights(_layers(self.frame_encoder), _layers(self.goal_encoder), _layers(self.gate), experts)

    def forward(self, frame: Tensor, goal: Tensor, gating: Tensor) -> Tensor:
        """`answer` with dropout on the encoders' inputs while training."""
        return answer(self.weights(), self.dropout(frame), self.dropout(goal), gating)


def _layers(stack: nn.Sequential) -> Layers:
    return tuple((layer.weight.T, layer.bias) for layer in stack if isinstance(layer, nn.Linear))


def _encoder(inputs: int, width: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inputs, width), nn.ELU(), nn.Linear(width, width), nn.ELU())


def normal(x: Tensor, mean: Tensor, std: Tensor) -> Tensor:
    """`x` in deviations, clipped at 8 of them so that one odd input cannot run away with the network."""
    return ((x - mean) / std).clamp(-8.0, 8.0)


class Normaliser(nn.Module):
    """Column means and deviations of inputs and outputs, saved with the weights."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        for name in ("frame", "goal", "gating", "output"):
            self.register_buffer(f"{name}_mean", torch.zeros(int(getattr(config, name))))
            self.register_buffer(f"{name}_std", torch.ones(int(getattr(config, name))))

    def apply_to(self, name: str, x: Tensor) -> Tensor:
        """Raw to normalised."""
        return normal(x, self.get_buffer(f"{name}_mean"), self.get_buffer(f"{name}_std"))

    def undo(self, name: str, x: Tensor) -> Tensor:
        """Normalised to raw."""
        return x * self.get_buffer(f"{name}_std") + self.get_buffer(f"{name}_mean")
