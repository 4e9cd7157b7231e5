"""Parallel roll-outs over episodes with the very step the service runs, each frame a supervised example."""

from dataclasses import fields

import torch
from torch import Tensor

from roam_motion.animation.advance import advance
from roam_motion.animation.figure import Figure
from roam_motion.animation.prediction import Predict
from roam_motion.animation.state import Characters
from roam_motion.models.lnsm.config import WHOLE, Parts
from roam_motion.models.lnsm.features import Inputs, encode, encode_targets
from roam_motion.training.dataset import Dataset
from roam_motion.training.expert import returning

_LOST = 0.6  # [m] root difference at which a roll-out starts again elsewhere


class Rollout:
    """B characters following episodes; start frames are drawn by weight, the present difference is carried along."""

    def __init__(
        self, figure: Figure, dataset: Dataset, batch: int, generator: torch.Generator, parts: Parts = WHOLE
    ) -> None:
        self.figure, self.dataset, self.generator, self.parts = figure, dataset, generator, parts
        self._cumulative = dataset.weight.double().cumsum(0)
        self.at = self._draw(batch)
        self.characters = dataset.characters(figure, self.at)

    def _draw(self, count: int) -> Tensor:
        chance = torch.rand(count, generator=self.generator, dtype=torch.float64) * self._cumulative[-1]
        at = torch.searchsorted(self._cumulative, chance).clamp_max(len(self.dataset) - 2)
        return torch.minimum(at, (self.dataset.last[at] - 1).clamp_min(0))

    def example(self) -> tuple[Inputs, Tensor, Tensor]:
        """Inputs, expert output [B, O], and whether the goal is active [B], for the present states."""
        figure, characters = self.figure, self.characters
        goals = self.dataset.goals(self.figure, self.at)
        truth, ahead = self.dataset.characters(figure, self.at), self.dataset.targets(figure, self.at)
        positions = figure.positions(characters.hips, characters.orientations)
        root = figure.frame(positions)
        inputs = self.parts.seen(encode(characters, goals, positions, root))
        targets = returning(figure, characters, positions, truth, ahead)
        return inputs, encode_targets(figure, characters, goals, positions, root, targets), goals.active

    @torch.no_grad()
    def step(self, predict: Predict, horizon: float) -> float:
        """Advances all roll-outs; each starts anew with chance 1/horizon, at an episode's end, or when lost.

        Returns the mean root difference from the data [m].
        """
        goals = self.dataset.goals(self.figure, self.at)
        after, positions, _ = advance(self.figure, predict, self.characters, goals, self.parts.blending())
        self.at = self.at + 1
        away = (positions[:, 0, [0, 2]] - self.dataset.root[self.at, :2]).norm(dim=-1)
        again = torch.rand(len(self.at), generator=self.generator) < 1 / horizon
        again |= (self.at >= self.dataset.last[self.at]) | ~(away < _LOST)
        self._restart(after, again)
        return float(away.nan_to_num(1.0).mean())

    def _restart(self, after: Characters, again: Tensor) -> None:
        rows = again.nonzero()[:, 0]
        if len(rows):
            self.at[rows] = self._draw(len(rows))
            fresh = self.dataset.characters(self.figure, self.at[rows])
            for f in fields(Characters):
                getattr(after, f.name)[rows] = getattr(fresh, f.name)
        self.characters = after
