"""Parallel roll-outs over episodes with the very step the service runs, each frame a supervised example.

Recorded people begin to sit down while they still walk; served characters come to stand before the seat, and begin from
there. So some roll-outs begin with someone who stands quietly on (about) the episode's feet when the command comes.
"""

import math
from dataclasses import fields

import torch
from torch import Tensor

from roam_motion.actions import IDLE, STYLES
from roam_motion.animation.advance import advance
from roam_motion.animation.figure import CONTACT_JOINTS, Figure
from roam_motion.animation.manner import NAMES
from roam_motion.animation.prediction import Predict
from roam_motion.animation.state import FUTURE, PAST, Characters
from roam_motion.models.lnsm.config import WHOLE, Parts
from roam_motion.models.lnsm.features import Inputs, encode, encode_targets
from roam_motion.training.data.dataset import Dataset
from roam_motion.training.learning.expert import returning
from roam_motion.training.learning.weights import start_poses

_LOST = 0.6  # [m] root difference at which a roll-out starts again elsewhere
_QUIET = 0.3  # of the restarts in interactions begin with someone who stands quietly
_PLACE, _TURN = 0.04, math.radians(10)  # standard deviation of such a one's feet and heading


class Rollout:
    """B characters following episodes; start frames are drawn by weight, the present difference is carried along."""

    def __init__(
        self, figure: Figure, dataset: Dataset, batch: int, generator: torch.Generator, parts: Parts = WHOLE
    ) -> None:
        self.figure, self.dataset, self.generator, self.parts = figure, dataset, generator, parts
        self._cumulative = dataset.weight.double().cumsum(0)
        self._quiet = dataset.quiet.nonzero()[:, 0]
        self._stances = start_poses(figure, dataset)
        able = len(self._quiet) > 0 and len(self._stances["start.height"]) > 0
        taking = (dataset.goal >= 0).double() * dataset.weight
        self._quiet_share = _QUIET * float(taking.sum() / self._cumulative[-1]) if able else 0.0
        self.at = self._draw(batch)
        self.characters = dataset.characters(figure, self.at)

    def _draw(self, count: int) -> Tensor:
        chance = torch.rand(count, generator=self.generator, dtype=torch.float64) * self._cumulative[-1]
        at = torch.searchsorted(self._cumulative, chance).clamp_max(len(self.dataset) - 2)
        return torch.minimum(at, (self.dataset.last[at] - 1).clamp_min(0))

    def example(self) -> tuple[Inputs, Tensor, Tensor]:
        """Raw inputs, expert output [B, O], and whether the goal is active [B], for the present states."""
        figure, characters = self.figure, self.characters
        goals = self.dataset.goals(self.at)
        truth, ahead = self.dataset.characters(figure, self.at), self.dataset.targets(figure, self.at)
        positions = figure.positions(characters.hips, characters.orientations)
        root = figure.frame(positions)
        inputs = encode(characters, goals, positions, root)
        targets = returning(figure, characters, positions, truth, ahead, goals)
        return inputs, encode_targets(figure, characters, goals, positions, root, targets), goals.active

    @torch.no_grad()
    def step(self, predict: Predict, horizon: float) -> float:
        """Advances all roll-outs; each starts anew with chance 1/horizon, at an episode's end, or when lost.

        Returns the mean root difference from the data [m].
        """
        goals = self.dataset.goals(self.at)
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
            self._put(after, rows, self.dataset.characters(self.figure, self.at[rows]))
            quiet = rows[torch.rand(len(rows), generator=self.generator) < self._quiet_share]
            if len(quiet):
                pick = torch.randint(len(self._quiet), (len(quiet),), generator=self.generator)
                self.at[quiet] = self._quiet[pick]
                self._put(after, quiet, self._standing(self.at[quiet]))
        self.characters = after

    def _put(self, after: Characters, rows: Tensor, fresh: Characters) -> None:
        for f in fields(Characters):
            getattr(after, f.name)[rows] = getattr(fresh, f.name)

    def _standing(self, at: Tensor) -> Characters:
        """Characters that have stood for a second on about the feet of frames `at` [B]."""
        figure, count, random = self.figure, len(at), self.generator
        pick = torch.randint(len(self._stances["start.height"]), (count,), generator=random)
        facing = self.dataset.root[at, 2:]
        yaw = torch.atan2(facing[:, 0], facing[:, 1]) + _TURN * torch.randn(count, generator=random)
        orientations = _about_vertical(yaw)[:, None] @ self._stances["start.orientations"][pick]
        hips = torch.zeros(count, 3)
        hips[:, 1] = self._stances["start.height"][pick]
        ankles = figure.contacts[[0, 2]]
        wanted = figure.positions(self.dataset.hips[at], self.dataset.orientations[at])[:, ankles].mean(1)
        own = figure.positions(hips, orientations)[:, ankles].mean(1)
        hips[:, ::2] = (wanted - own)[:, ::2] + _PLACE * torch.randn(count, 2, generator=random)
        return standing(figure, hips, orientations, self.dataset.phase[at].remainder(1.0))


def standing(figure: Figure, hips: Tensor, orientations: Tensor, phase: Tensor) -> Characters:
    """Characters that have stood still for a second: hips [B, 3], world orientations [B, J, 3, 3], gait phase [B]."""
    positions = figure.positions(hips, orientations)
    frame, count = figure.frame(positions), len(hips)
    idle = torch.tensor([float(style == IDLE.style) for style in STYLES]).expand(count, -1)
    planted = torch.ones(count, len(CONTACT_JOINTS))
    row = torch.cat([frame.origin, frame.direction, idle, phase[:, None]], 1)[:, None]
    return Characters(
        hips=hips,
        orientations=orientations,
        velocities=torch.zeros_like(positions),
        past=row.repeat(1, PAST, 1),
        future=row.repeat(1, FUTURE, 1),
        contacts=planted,
        locks=positions[:, figure.contacts],
        lock_weights=planted.clone(),
        settled=torch.zeros(count),
        blend=torch.zeros(count),
        standing=torch.ones(count),
        steps=torch.zeros(count, 2),
        manner=torch.zeros(count, len(NAMES)),
        gaze=torch.zeros(count, 3),
    )


def _about_vertical(yaw: Tensor) -> Tensor:
    """Turns about +Y [B, 3, 3]."""
    cosine, sine, zero, one = yaw.cos(), yaw.sin(), torch.zeros_like(yaw), torch.ones_like(yaw)
    return torch.stack([cosine, zero, sine, zero, one, zero, -sine, zero, cosine], -1).reshape(-1, 3, 3)
