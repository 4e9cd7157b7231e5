"""Points and scraps that do not belong to the object: far away, or hanging in the air."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.spatial import cKDTree

from roam_goalpose.objects.geometry import Array

Mask = npt.NDArray[np.bool_]

_OUTER = 0.01  # share at either end of each axis that says nothing about where the object is
_WIDER = 1.0  # times the object's box that is still looked at on every side of it
_CELLS = 32  # along the object's longest side
_LEAST = 0.02  # of the points: what fewer points hang apart with is a scrap
_FEW = 4  # points of a sample to measure its spacing
_MOST_AWAY = 0.03  # more than this share of points far away are a second object, no strays


def belongs(points: Array, weights: Array | None = None) -> Mask:
    """Which of points `[N, 3]` belong to the object: all but those far away, and scraps apart from it.

    Args:
        points: in any unit.
        weights: `[N]` what each stands for (areas); all alike when None.
    """
    kept = _near(points)
    if float(kept.mean()) < 1 - _MOST_AWAY:
        return np.ones(len(points), dtype=bool)
    inside = points[kept]
    low, extent = inside.min(axis=0), np.ptp(inside, axis=0)
    cell = max(float(extent.max()) / _CELLS, _FEW * _spacing(inside), 1e-12)
    cells = np.floor((inside - low) / cell).astype(np.int64) + 1
    grid = np.zeros(cells.max(axis=0) + 2, dtype=bool)
    grid[tuple(cells.T)] = True
    labels, count = ndimage.label(grid, structure=np.ones((3, 3, 3)))
    if count == 1:
        return kept
    of = labels[tuple(cells.T)]
    share = np.bincount(of, weights=None if weights is None else weights[kept], minlength=count + 1).astype(np.float64)
    share /= share.sum()
    kept[np.flatnonzero(kept)[share[of] < _LEAST]] = False
    return kept


def _near(points: Array) -> Mask:
    """Points in the box of (nearly) all, widened by its own size."""
    low, high = np.quantile(points, [_OUTER, 1 - _OUTER], axis=0)
    margin = _WIDER * float((high - low).max())
    near: Mask = ((points > low - margin) & (points < high + margin)).all(axis=1)
    return near


def _spacing(points: Array) -> float:
    """The usual distance of a point to its nearest neighbours."""
    sample = points[:: max(len(points) // 2000, 1)]
    distances, _ = cKDTree(points).query(sample, k=_FEW)
    return float(np.median(np.asarray(distances)[:, -1]))
