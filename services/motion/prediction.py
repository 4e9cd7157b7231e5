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
    """Weights made ready once, called for every frame."""

    def __init__(self, network: MotionNetwork, normaliser: Normaliser) -> None:
        self._weights = network.weights().contiguous()
        config = network.config
        self._widths = [config.frame, config.goal, config.gating]
        self._mean, self._std = (
            torch.cat([normaliser.get_buffer(f"{part}_{kind}") for part in ("frame", "goal", "gating")])
            for kind in ("mean", "std")
        )
        self._normaliser = normaliser

    def __call__(self, inputs: Inputs) -> Tensor:
        """The raw output [B, O]."""
        rows = normal(torch.cat([inputs.frame, inputs.goal, inputs.gating], 1), self._mean, self._std)
        chunks = pad(rows, (0, 0, 0, -len(rows) % _ROWS)).split(_ROWS)
        answers = [answer(self._weights, *chunk.split(self._widths, 1)) for chunk in chunks]
        return self._normaliser.undo("output", torch.cat(answers)[: len(rows)])
