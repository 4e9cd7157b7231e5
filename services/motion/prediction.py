"""The network as the service asks it: raw inputs to raw answers, in chunks of one shape."""

import torch
from torch import Tensor
from torch.nn.functional import pad

from motion.features import Inputs
from motion.network import MotionNetwork, Normaliser, answer, normal

# Padded to a multiple of this many rows: matrix products of one shape give the same bits whatever the other rows hold,
# so that a session's motion does not depend on its neighbours. A chunk reads all weights once, 8 MB: 16 rows cost half
# as much as two times 8, and one character 0.2 ms more than in a chunk of 8.
_ROWS = 16


class Prediction:
    """Weights made ready once, asked for every frame."""

    def __init__(self, network: MotionNetwork, normaliser: Normaliser) -> None:
        self._weights = network.weights().contiguous()
        config = network.config
        self._widths = [config.frame, config.goal, config.gating]
        self._mean, self._std = (
            torch.cat([normaliser.get_buffer(f"{part}_{kind}") for part in ("frame", "goal", "gating")])
            for kind in ("mean", "std")
        )
        self._normaliser = normaliser
        chunk = torch.zeros(_ROWS, sum(self._widths))
        with torch.no_grad():
            self._chunk = torch.jit.trace(self._answer, (chunk,), check_trace=False)

    def normalised(self, inputs: Inputs) -> Tensor:
        """What the network is given [B, F + G + S]."""
        return normal(torch.cat([inputs.frame, inputs.goal, inputs.gating], 1), self._mean, self._std)

    def answers(self, rows: Tensor) -> Tensor:
        """Normalised inputs [B, F + G + S] -> the raw output [B, O]."""
        chunks = pad(rows, (0, 0, 0, -len(rows) % _ROWS)).split(_ROWS)
        return torch.cat([self._chunk(chunk) for chunk in chunks])[: len(rows)]

    def _answer(self, chunk: Tensor) -> Tensor:
        return self._normaliser.undo("output", answer(self._weights, *chunk.split(self._widths, 1)))
