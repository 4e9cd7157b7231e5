"""The network as the service asks it: raw inputs to raw answers, in chunks of few shapes."""

import torch
from torch import Tensor
from torch.nn.functional import pad

from motion.features import Inputs
from motion.network import MotionNetwork, Normaliser, answer, normal

# Numbers of rows that the network is asked with; batches are padded to a sum of them. Matrix products of one shape give
# the same bits whatever the other rows hold, so a session's motion does not depend on its neighbours. A product reads
# all weights, 8 MB: 64 rows at once cost 2.5 ms, as four times 16 they cost 3.6. Only sizes whose rows come out alike,
# to the bit, on this very processor are used.
_SIZES = 8, 16, 32, 64


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
        with torch.no_grad():
            self._chunk = torch.jit.trace(self._answer, (torch.zeros(_SIZES[0], len(self._mean)),), check_trace=False)
            self.sizes = self._alike()  # numbers of rows to ask with, the largest first

    def normalised(self, inputs: Inputs) -> Tensor:
        """What the network is given [B, F + G + S]."""
        return normal(torch.cat([inputs.frame, inputs.goal, inputs.gating], 1), self._mean, self._std)

    def answers(self, rows: Tensor) -> Tensor:
        """Normalised inputs [B, F + G + S] -> the raw output [B, O]."""
        rest, answers = pad(rows, (0, 0, 0, -len(rows) % self.sizes[-1])), []
        for size in self.sizes:
            whole = len(rest) - len(rest) % size
            if whole:
                answers.append(self._together(rest[:whole], size))
            rest = rest[whole:]
        return torch.cat(answers)[: len(rows)]

    def _alike(self) -> list[int]:
        """Those sizes that answer every row as the smallest one does."""
        rows = torch.randn(_SIZES[-1], len(self._mean), generator=torch.Generator().manual_seed(0))
        singly = self._together(rows, _SIZES[0])
        return [size for size in reversed(_SIZES) if torch.equal(self._together(rows, size), singly)]

    def _together(self, rows: Tensor, size: int) -> Tensor:
        return torch.cat([self._chunk(chunk) for chunk in rows.split(size)])

    def _answer(self, chunk: Tensor) -> Tensor:
        return self._normaliser.undo("output", answer(self._weights, *chunk.split(self._widths, 1)))
