"""l-NSM as a motion model: loaded from its weights, asked in chunks of few shapes."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import torch
from roam_character.tensors.torchscript import scripted, traced
from torch import Tensor

from roam_motion.animation.blending import Blending
from roam_motion.animation.figure import Figure, Frame
from roam_motion.animation.prediction import Goals, Predict, Prediction
from roam_motion.animation.state import Characters
from roam_motion.models.lnsm.config import NetworkConfig, Parts
from roam_motion.models.lnsm.features import Inputs, decode, encode
from roam_motion.models.lnsm.network import MotionNetwork, Normaliser, answer, normal

KEY = "l-nsm"  # of this model in weights files

# Numbers of rows that the network is asked with, by the smallest of them; batches are padded to a sum of them. Matrix
# products of one shape give a row the same bits whatever the other rows hold, but not always at every place: MKL's AVX2
# kernels take rows by six and round the last two of eight otherwise. So the first family counts whose smallest size
# answers alike at all places, on this very processor, and of it the sizes that agree. A product reads all weights,
# 8 MB: 64 rows at once cost 2.5 ms, as four times 16 they cost 3.6.
_FAMILIES = (8, 16, 32, 64), (12, 24, 48), (16, 48), (1,)
_PROBES = 3  # rows that are tried


@dataclass(frozen=True, eq=False)
class LnsmModel:
    """A network with its normaliser and the stances that characters start from; see `models.registry.MotionModel`."""

    figure: Figure
    network: MotionNetwork
    normaliser: Normaliser
    starts: Mapping[str, Tensor]  # "height" [S] of the hips [m], "orientations" [S, J, 3, 3] facing +Z

    @property
    def blending(self) -> Blending:
        """How its answers meet the goal."""
        return self.network.config.parts.blending()

    def predictor(self) -> Predict:
        """Its weights made ready to be asked for every frame."""
        return predicting(
            self.figure.joint_count, self.network.config.parts, ChunkedNetwork(self.network, self.normaliser)
        )


def load(figure: Figure, metadata: Mapping[str, str], tensors: Mapping[str, Tensor]) -> LnsmModel:
    """From what a weights file holds."""
    config = NetworkConfig.from_dict(json.loads(metadata["config"]))
    network, normaliser = MotionNetwork(config), Normaliser(config)
    network.load_state_dict(_part(tensors, "network."))
    normaliser.load_state_dict(_part(tensors, "normaliser."))
    return LnsmModel(figure, network, normaliser, _part(tensors, "start."))


def _part(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}


def predicting(joints: int, parts: Parts, raw: Callable[[Inputs], Tensor]) -> Predict:
    """A raw network, inputs -> output [B, O], as a motion model."""

    def predict(characters: Characters, goals: Goals, positions: Tensor, root: Frame) -> Prediction:
        output = raw(parts.seen(encode(characters, goals, positions, root)))
        return decode(parts.answered(joints, output), characters, positions, root)

    return predict


class ChunkedNetwork:
    """Raw inputs to raw outputs; weights are made ready once."""

    def __init__(self, network: MotionNetwork, normaliser: Normaliser) -> None:
        self._weights = network.weights().contiguous()
        config = network.config
        self._widths = [config.frame, config.goal, config.gating]
        self._mean, self._std = (
            torch.cat([normaliser.get_buffer(f"{part}_{kind}") for part in ("frame", "goal", "gating")])
            for kind in ("mean", "std")
        )
        self._normaliser = normaliser
        chunk = traced(self._answer, torch.zeros(_FAMILIES[0][0], len(self._mean)))
        self._sizes = _alike(chunk, len(self._mean))
        self._answers = _chunked(chunk)

    def __call__(self, inputs: Inputs) -> Tensor:
        """The raw output [B, O]."""
        rows = torch.cat([inputs.frame, inputs.goal, inputs.gating], 1)
        output: Tensor = self._answers(normal(rows, self._mean, self._std), self._sizes)
        return output

    def _answer(self, chunk: Tensor) -> Tensor:
        return self._normaliser.undo("output", answer(self._weights, *chunk.split(self._widths, 1)))


Chunk = Callable[[Tensor], Tensor]


def _chunked(chunk: Chunk) -> Callable[[Tensor, list[int]], Tensor]:
    """A script, so that it can be part of a graph: rows [B, F + G + S] in chunks of some sizes, the largest first."""

    def answers(rows: Tensor, sizes: list[int]) -> Tensor:
        count = rows.shape[0]
        rest = torch.constant_pad_nd(rows, [0, 0, 0, -count % sizes[-1]])
        parts: list[Tensor] = []
        for size in sizes:
            while rest.shape[0] >= size:
                parts.append(chunk(rest[:size]))
                rest = rest[size:]
        return torch.cat(parts)[:count]

    return scripted(answers)


def _alike(chunk: Chunk, width: int) -> list[int]:
    """Sizes that answer every row alike at every place, the largest first."""
    probes = torch.randn(_PROBES, width, generator=torch.Generator().manual_seed(0))
    for smallest, *larger in _FAMILIES:
        own = [chunk(probe.expand(smallest, -1)) for probe in probes]
        if all(_one_answer(answers, answers[:1]) for answers in own):
            alike = [size for size in larger if _agrees(chunk, probes, size, own)]
            return [*reversed(alike), smallest]
    raise AssertionError("a single row has one answer")


def _agrees(chunk: Chunk, probes: Tensor, size: int, answers: Sequence[Tensor]) -> bool:
    """Whether so many rows are answered as the smallest size answers them."""
    return all(_one_answer(chunk(probe.expand(size, -1)), own[:1]) for probe, own in zip(probes, answers, strict=True))


def _one_answer(answers: Tensor, expected: Tensor) -> bool:
    """Whether all rows are `expected` [1, O], to the bit."""
    return torch.equal(answers, expected.expand_as(answers))
