"""How good a field is on shapes it has not seen: occupancy IoU per category, plain and with a 3 cm tolerance band."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from goalpose.field import Field
from goalpose.training.store import Store

BAND = 0.03
"""Half width [m] of the tolerance band: points closer to the surface are not counted."""


@dataclass(frozen=True)
class ShapeScore:
    """Scores of one object."""

    name: str
    category: str
    iou: float
    """Intersection over union of predicted and true inside, over uniform queries in the padded box."""
    banded: float
    """The same, counting only points that are wrong by more than the band: inside must be met up to 3 cm."""
    front_error: float
    """Mean error of the predicted place along the seat's front [m]."""


@torch.no_grad()
def score_store(field: Field, store: Store, *, cloud: int = 1024, queries: int = 4000, threshold: float = 0.0) -> list[ShapeScore]:
    """Scores of every object of a store; deterministic."""
    scores: list[ShapeScore] = []
    for row in range(len(store)):
        random = np.random.default_rng([4, row])
        surface = store.surface[row].astype(np.float32)
        points = torch.from_numpy(surface[random.permutation(len(surface))[:cloud]])[None]
        where = torch.from_numpy(store.queries[row, :queries].astype(np.float32))[None]
        distance = torch.from_numpy(store.distance[row, :queries].astype(np.float32))
        answer = field.answer(field.encode(points), where)
        iou, banded = occupancy_iou(answer.logit[0] > threshold, distance)
        front = (answer.place[0, :, 2] - where[0, :, 2]).abs().mean()
        scores.append(ShapeScore(store.names[row], store.categories[row], iou, banded, float(front)))
    return scores


def occupancy_iou(predicted: Tensor, distance: Tensor) -> tuple[float, float]:
    """IoU `[Q]` against the sign of the distance, plain and with the tolerance band.

    With the band, a point counts as a miss (or as false) only if it lies more than `BAND` inside (outside) the true
    surface; hits count everywhere. A shape without any countable point scores 1.
    """
    inside = distance < 0
    hits = (predicted & inside).sum()
    union = (predicted | inside).sum()
    missed = (~predicted & (distance < -BAND)).sum()
    false = (predicted & (distance > BAND)).sum()
    plain = float(hits / union) if union > 0 else 1.0
    tolerated = (predicted & (distance < BAND)).sum()
    counted = tolerated + missed + false
    return plain, float(tolerated / counted) if counted > 0 else 1.0


def by_category(scores: Sequence[ShapeScore]) -> dict[str, dict[str, float]]:
    """Mean scores per category and over all shapes (`all`)."""
    groups: dict[str, list[ShapeScore]] = defaultdict(list)
    for score in scores:
        groups[score.category].append(score)
        groups["all"].append(score)
    return {
        category: {
            "shapes": len(group),
            "iou": round(float(np.mean([s.iou for s in group])), 4),
            "iou_3cm": round(float(np.mean([s.banded for s in group])), 4),
            "front_error_m": round(float(np.mean([s.front_error for s in group])), 4),
        }
        for category, group in sorted(groups.items())
    }
