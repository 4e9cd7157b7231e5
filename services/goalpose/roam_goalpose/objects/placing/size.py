"""How tall an object must be for a body to use it: a regression from its shape, whatever unit its numbers are in.

A chair scaled by two keeps its proportions, but no chair of its proportions has its seat at 0.9 m: what matters is
where the level areas are relative to the height and how wide the object is beside it. `describe_shape` turns an object
that stands on its feet into numbers that do not change with its size; a Gaussian process
(Rasmussen & Williams 2006, chapter 2) over furniture of known size answers with the logarithm of its height, and how
unlike all of that furniture it is. Fitted by `size_fit`, which prints how well it does on objects left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.spatial import ConvexHull, QhullError

from roam_goalpose.objects.geometry import Array

_MODEL = Path(__file__).with_name("size.npz")  # written by `python -m roam_goalpose.objects.placing.size_fit`
_POINTS = 5000  # samples looked at
_CELLS = 20  # of the height map, along the cube root of the box's volume
_LEVEL = 0.9  # cosine of what counts as level
# Chosen by cross-validated likelihood among 0.7, 1, 1.5, 2.5 and 0.1, 0.15, 0.2 (see size_fit).
LENGTH, NOISE, AMPLITUDE = 1.5, 0.1, 0.5

Directions = npt.NDArray[np.floating]


@dataclass(frozen=True)
class Size:
    """What the shape says about its size.

    Attributes:
        log_height: of the expected height [m].
        deviation: of `log_height`; 0.1 for a shape like many known ones, 0.5 for one like none.
    """

    log_height: float
    deviation: float

    @property
    def height(self) -> float:
        """Expected height [m]."""
        return float(np.exp(self.log_height))


def describe_shape(points: Array, normals: Directions, rotation: Array) -> Array:
    """The numbers `[K]` of samples `[N, 3]` in any unit, with normals of either sign, that `rotation` `[3, 3]` sets on
    their feet."""
    points = points[:_POINTS] @ rotation.T
    points = points - points.min(axis=0)
    height = max(float(points[:, 1].max()), 1e-9)
    relative = points[:, 1] / height
    level = np.abs(normals[:_POINTS] @ rotation[1]) > _LEVEL
    long, short = _rectangle(points[:, ::2])
    cell = max((long * short * height) ** (1 / 3), 1e-9) / _CELLS
    cells = np.floor(points[:, ::2] / cell).astype(np.int64)
    _, inverse = np.unique(cells[:, 0] * 1_000_000 + cells[:, 1], return_inverse=True)
    top = np.full(inverse.max() + 1, -np.inf)
    bottom = np.full(inverse.max() + 1, np.inf)
    np.maximum.at(top, inverse, relative)
    np.minimum.at(bottom, inverse, relative)
    return np.array(
        [
            np.log(long / height + 1e-3),
            np.log(short / height + 1e-3),
            np.log(short / max(long, 1e-9) + 1e-3),
            *np.sqrt(_share(relative[level], 16, len(points))),
            *np.sqrt(_share(relative, 10, len(points))),
            *np.sqrt(_share(top, 12, len(top))),
            *np.sqrt(_share(bottom, 8, len(bottom))),
            len(top) * cell * cell / max(long * short, 1e-12),
        ]
    )


def expected_size(shape: Array) -> Size:
    """The height that an object of `describe_shape` numbers should have."""
    return GaussianProcess.load().predict(shape)


@dataclass(frozen=True, eq=False)
class GaussianProcess:
    """Squared-exponential kernel over shape numbers of mean 0 and deviation 1."""

    shapes: Array  # [N, K] as described
    log_heights: Array  # [N]
    mean: Array  # [K]
    deviation: Array  # [K]
    factor: tuple[Array, bool]
    weights: Array  # [N]

    @staticmethod
    def fit(shapes: Array, log_heights: Array) -> GaussianProcess:
        """Condition on furniture of known size."""
        mean, deviation = shapes.mean(axis=0), shapes.std(axis=0) + 1e-6
        unit = (shapes - mean) / deviation
        factor = cho_factor(_kernel(unit, unit) + NOISE**2 * np.eye(len(unit)), lower=True)
        weights = cho_solve(factor, log_heights - log_heights.mean())
        return GaussianProcess(shapes, log_heights, mean, deviation, factor, weights)

    @staticmethod
    @cache
    def load() -> GaussianProcess:
        """The shipped one."""
        with np.load(_MODEL) as arrays:
            return GaussianProcess.fit(arrays["shapes"].astype(np.float64), arrays["log_heights"].astype(np.float64))

    def predict(self, shape: Array) -> Size:
        """Mean and deviation (Rasmussen & Williams, equations 2.25 and 2.26)."""
        near = _kernel(((shape - self.mean) / self.deviation)[None], (self.shapes - self.mean) / self.deviation)[0]
        explained = solve_triangular(self.factor[0], near, lower=True)
        variance = max(AMPLITUDE**2 - float(explained @ explained), 0.0) + NOISE**2
        return Size(float(near @ self.weights + self.log_heights.mean()), float(np.sqrt(variance)))


def _kernel(first: Array, second: Array) -> Array:
    apart = (first**2).sum(1)[:, None] + (second**2).sum(1)[None] - 2 * first @ second.T
    kernel: Array = AMPLITUDE**2 * np.exp(-np.maximum(apart, 0) / (2 * LENGTH**2 * first.shape[1]))
    return kernel


def _share(values: Array, bins: int, whole: int) -> Array:
    return np.histogram(values, bins=bins, range=(0.0, 1.0))[0] / max(whole, 1)


def _rectangle(footprint: Array) -> tuple[float, float]:
    """Longer and shorter side of the smallest rectangle around points `[N, 2]`."""
    try:
        hull = footprint[ConvexHull(footprint).vertices]
    except QhullError:  # all on one line
        hull = footprint
    edges = np.roll(hull, -1, axis=0) - hull
    long_enough = np.hypot(edges[:, 0], edges[:, 1]) > 1e-9
    yaw = np.arctan2(edges[:, 1], edges[:, 0])[long_enough][:512]
    if not len(yaw):
        return 1e-9, 1e-9
    along, across = np.stack([np.cos(yaw), np.sin(yaw)]), np.stack([-np.sin(yaw), np.cos(yaw)])
    width, depth = np.ptp(hull @ along, axis=0), np.ptp(hull @ across, axis=0)
    best = int((width * depth).argmin())
    sides = sorted((float(width[best]), float(depth[best])))
    return sides[1], sides[0]
