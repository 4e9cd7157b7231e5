"""Which way is up: a score for every direction, from what furniture looks like when it stands on its feet.

Formats other than glTF do not say whether Y or Z is up. Each candidate is described by a few numbers that do not change
when the object turns about it (a height map seen from above and from below, the support it would stand on, the
distribution of area over height); a model of these numbers and their products ranks the candidates: a level plane near
the floor speaks for a bed but against a chair. It is fitted by `upright_fit`, which also prints how often it is right.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError

from roam_goalpose.objects.geometry import Array
from roam_goalpose.objects.placing.axes import up_rotation

Directions = npt.NDArray[np.floating]

_CELL = 0.04  # [m] height map
_POINTS = 5000  # samples looked at: two or more per cell of a large sofa's height map
_TOUCH = 0.02  # [m] what is this near the lowest point touches the floor


FEATURES = (
    "support_share",
    "support_margin",
    "touching",
    "mean_height",
    "spread",
    "asymmetry",
    "low_share",
    "high_share",
    "level_share",
    "plane_share",
    "plane_at_seat",
    "plane_at_floor",
    "plane_at_top",
    "top_at_seat",
    "top_low",
    "top_high",
    "top_flat",
    "covered",
    "clearance",
    "grounded",
    "tall",
    "tall_squared",
    "slender",
)
"""What `describe` returns, in order."""
_MODEL = Path(__file__).with_name("upright.json")  # written by `python -m roam_goalpose.objects.placing.upright_fit`
_SURE = 0.95


@dataclass(frozen=True)
class UpGuess:
    """An up axis, its probability, and how sure we are (`doubt` is empty or a sentence)."""

    up: str
    probability: float
    doubt: str


def choose_up(scores: Mapping[str, float]) -> UpGuess:
    """Which of some up axes it is, from their scores (log-odds)."""
    best = max(scores, key=lambda up: scores[up])
    others = sum(math.exp(max(min(scores[up] - scores[best], 0.0), -50.0)) for up in scores if up != best)
    probability = 1.0 / (1.0 + others)
    doubt = ""
    if probability < _SURE:
        doubt = f"The up axis was taken as {best} ({probability:.0%} sure); give it to be certain."
    return UpGuess(best, probability, doubt)


def upright_score(points: Array, normals: Directions, up: str) -> float:
    """How much an object looks like furniture on its feet when `up` points up: log-odds, comparable between axes."""
    return score_turned(points, normals, up_rotation(up))


def score_turned(points: Array, normals: Directions, rotation: Array) -> float:
    """The same for an object that `rotation` `[3, 3]` sets on its feet."""
    mean, deviation, weights = _model()
    return float(products((describe(points, normals, rotation) - mean) / deviation) @ weights)


@cache
def _model() -> tuple[Array, Array, Array]:
    """Mean and deviation of the features `[K]`, and the weights `[K + K (K + 1) / 2]` of `products`."""
    model = json.loads(_MODEL.read_text())
    return np.array(model["mean"]), np.array(model["deviation"]), np.array(model["weights"])


def products(features: Array) -> Array:
    """Features `[..., K]` of mean 0 and deviation 1, and behind them the product of every two of them."""
    first, second = np.triu_indices(features.shape[-1])
    return np.concatenate([features, features[..., first] * features[..., second]], -1)


def describe(points: Array, normals: Directions, rotation: Array) -> Array:
    """The features `[K]` of an object [m] that `rotation` `[3, 3]` sets on its feet, named by `FEATURES`."""
    points = points[:_POINTS] @ rotation.T
    points = points - points.min(axis=0)
    level = np.abs(normals[:_POINTS] @ rotation[1])
    height = points[:, 1]
    tall = max(float(height.max()), 1e-6)
    top, bottom = _height_map(points)
    return np.array(
        [
            *_support(points),
            *_profile(height, tall),
            *_plane(height, level),
            *_seen_from_above(top),
            *_seen_from_below(bottom),
            *_size(points),
        ]
    )


def _support(points: Array) -> tuple[float, float, float]:
    """Area of what it stands on over the area it covers; how well the centre of mass is inside; share that touches."""
    touching = points[:, 1] < _TOUCH
    whole = _hull(points[:, ::2])
    base = _hull(points[touching][:, ::2])
    if whole is None or base is None:
        return 0.0, -0.5, float(touching.mean())
    centre = points[:, ::2].mean(axis=0)
    margin = -float((base.equations[:, :2] @ centre + base.equations[:, 2]).max())
    size = float(np.sqrt(whole.volume))
    return float(base.volume / whole.volume), float(np.clip(margin / size, -0.5, 0.5)), float(touching.mean())


def _hull(points: Array) -> ConvexHull | None:
    if len(points) < 4:
        return None
    try:
        return ConvexHull(points)
    except QhullError:  # all on one line
        return None


def _profile(height: Array, tall: float) -> tuple[float, float, float, float, float]:
    """How area is spread over height: mean, deviation, difference to its own mirror image, lowest and highest tenth."""
    share = np.histogram(height / tall, bins=20, range=(0.0, 1.0))[0] / len(height)
    asymmetry = float(np.abs(np.cumsum(share) - np.cumsum(share[::-1])).mean())
    return (
        float(height.mean() / tall),
        float(height.std() / tall),
        asymmetry,
        float(share[:2].sum()),
        float(share[-2:].sum()),
    )


def _plane(height: Array, level: Array) -> tuple[float, float, float, float, float]:
    """Level area, and the height at which most of it lies."""
    flat = level > 0.9
    if not flat.any():
        return 0.0, 0.0, 0.0, 0.0, 0.0
    bins = np.histogram(height[flat], bins=np.arange(0.0, float(height.max()) + 0.1, 0.05))[0]
    peak = int(bins.argmax())
    at = 0.05 * (peak + 0.5)
    share = float(bins[peak] / len(height))
    return (
        float(flat.mean()),
        share,
        share * float(np.exp(-(((at - 0.45) / 0.12) ** 2))),
        share * float(at < 0.1),
        share * float(at > height.max() - 0.1),
    )


def _height_map(points: Array) -> tuple[Array, Array]:
    """Highest and lowest point of every covered cell [m]."""
    cells = np.floor(points[:, ::2] / _CELL).astype(np.int64)
    _, inverse = np.unique(cells[:, 0] * 100_000 + cells[:, 1], return_inverse=True)
    top = np.full(inverse.max() + 1, -np.inf)
    bottom = np.full(inverse.max() + 1, np.inf)
    np.maximum.at(top, inverse, points[:, 1])
    np.minimum.at(bottom, inverse, points[:, 1])
    return top, bottom


def _seen_from_above(top: Array) -> tuple[float, float, float, float, float]:
    """Shares of the seen area at seat height, near the floor, near the top, in one level; and the covered area."""
    tall = top.max()
    bins = np.histogram(top, bins=np.arange(0.0, tall + 0.12, 0.06))[0]
    return (
        float(((top > 0.3) & (top < 0.6)).mean()),
        float((top < 0.12).mean()),
        float((top > tall - 0.12).mean()),
        float(bins.max() / len(top)),
        float(np.sqrt(len(top)) * _CELL),
    )


def _seen_from_below(bottom: Array) -> tuple[float, float]:
    """Share of the covered area with legroom below, and with almost none."""
    return float((bottom > 0.25).mean()), float((bottom < 0.06).mean())


def _size(points: Array) -> tuple[float, float, float]:
    """Height in metres (and squared, about the usual 0.85 m), and over the longer side."""
    extents = points.max(axis=0)
    return float(extents[1]), float((extents[1] - 0.85) ** 2), float(extents[1] / max(extents[0], extents[2], 1e-6))
