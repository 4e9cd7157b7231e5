"""Roll-out validation on held-out clips: what picks the checkpoint."""

import torch
from torch import Tensor

from roam_motion.animation.advance import advance
from roam_motion.animation.figure import Figure
from roam_motion.animation.prediction import Predict
from roam_motion.models.lnsm.config import WHOLE, Parts
from roam_motion.training.data.dataset import Dataset

_FRAMES = 120
_CHARACTERS = 96


def starts(dataset: Dataset, generator: torch.Generator, count: int = _CHARACTERS) -> Tensor:
    """Fixed start frames, drawn by weight, that leave room for a whole roll-out where the episode allows."""
    cumulative = dataset.weight.double().cumsum(0)
    at = torch.searchsorted(cumulative, torch.rand(count, generator=generator, dtype=torch.float64) * cumulative[-1])
    at = at.clamp_max(len(dataset) - 1)
    return torch.maximum(torch.minimum(at, dataset.last[at] - _FRAMES), dataset.first[at])


@torch.no_grad()
def rollout_scores(
    figure: Figure, dataset: Dataset, predict: Predict, generator: torch.Generator, parts: Parts = WHOLE
) -> dict[str, float]:
    """Four seconds from many held-out states.

    Returns metres: `root` mean root difference, `pose` mean joint difference in the root frame, `goal` mean joint
    distance to the goal pose where it is held in the data, `slide` mean slide of a planted ankle per second; and their
    `score`.
    """
    at = starts(dataset, generator)
    characters = dataset.characters(figure, at)
    roots, poses, goals, slides = [], [], [], []
    previous = figure.positions(characters.hips, characters.orientations)
    for _ in range(_FRAMES):
        characters, positions, distance = advance(figure, predict, characters, dataset.goals(at), parts.blending())
        running = at < dataset.last[at]
        at = torch.minimum(at + 1, dataset.last[at])
        truth = figure.positions(dataset.hips[at], dataset.orientations[at])
        own, other = figure.frame(positions), figure.frame(truth)
        roots.append((own.origin - other.origin).norm(dim=-1)[running])
        poses.append((own.points_in(positions) - other.points_in(truth)).norm(dim=-1).mean(-1)[running])
        row = dataset.goal[at]
        held = (row >= 0) & (dataset.goal_active[row.clamp_min(0)] > 0)
        near = (truth - dataset.goal_positions[row.clamp_min(0)]).norm(dim=-1).mean(-1) < 0.02
        goals.append(distance[held & near & running])
        ankles = figure.contacts[[0, 2]]
        moved = (positions[:, ankles] - previous[:, ankles])[..., [0, 2]].norm(dim=-1) * 30
        slides.append(moved[(dataset.contacts[at][:, [0, 2]] > 0.5) & running[:, None]])
        previous = positions
    return _scores(roots, poses, goals, slides)


def _scores(roots: list[Tensor], poses: list[Tensor], goals: list[Tensor], slides: list[Tensor]) -> dict[str, float]:
    def mean(parts: list[Tensor]) -> float:
        joined = torch.cat(parts)
        return float(joined.nan_to_num(10.0).mean()) if len(joined) else 0.0

    scores = {"root": mean(roots), "pose": mean(poses), "goal": mean(goals), "slide": mean(slides)}
    return {**scores, "score": scores["root"] + scores["pose"] + scores["goal"] + 0.2 * scores["slide"]}
