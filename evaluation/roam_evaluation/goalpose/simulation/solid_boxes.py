"""An object as a heap of boxes, for simulators that only collide convex things."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from roam_goalpose.objects import DistanceGrid, Shape

Array = npt.NDArray[np.floating]
Cells = npt.NDArray[np.intp]

CELL = 0.01  # [m]


@dataclass(frozen=True, eq=False)
class Boxes:
    """N boxes with axes along the world's."""

    centers: Array  # [N, 3] [m]
    half: Array  # [N, 3] [m]


def solid_boxes(shape: Shape, near: Array, *, reach: float = 0.3, cell: float = CELL) -> Boxes:
    """The inside of an object, in cells of `cell` [m] joined to boxes; only what lies in the box of the points `near`
    [P, 3] padded by `reach` [m], where the body is."""
    low = np.maximum(shape.bounds[0] - cell, near.min(0) - reach)
    high = np.minimum(shape.bounds[1] + cell, near.max(0) + reach)
    inside = _inside(shape.distance, low, high, cell)
    first, last = _joined(inside)
    corner, opposite = low + cell * first, low + cell * (last + 1)
    return Boxes((corner + opposite) / 2, (opposite - corner) / 2)


def _inside(distance: DistanceGrid, low: Array, high: Array, cell: float) -> npt.NDArray[np.bool_]:
    """Which cells have their middle in the object. -> [X, Y, Z]."""
    axes = [np.arange(low[a] + cell / 2, high[a], cell) for a in range(3)]
    slices = [np.stack(np.meshgrid([x], axes[1], axes[2], indexing="ij"), axis=-1) for x in axes[0]]
    return np.concatenate([distance.sample(part) < 0 for part in slices])


def _joined(inside: npt.NDArray[np.bool_]) -> tuple[Cells, Cells]:
    """First and last cells [N, 3] of boxes that cover the marked cells: runs along x, joined along z, then along y."""
    padded = np.pad(inside, ((1, 1), (0, 0), (0, 0))).astype(np.int8)
    change = np.diff(padded, axis=0)
    y, z, begin = np.nonzero(np.moveaxis(change, 0, -1) == 1)
    end = np.nonzero(np.moveaxis(change, 0, -1) == -1)[2] - 1
    first, last = np.stack([begin, y, z], axis=-1), np.stack([end, y, z], axis=-1)
    for axis in (2, 1):
        first, last = _stacked(first, last, axis)
    return first, last


def _stacked(first: Cells, last: Cells, axis: int) -> tuple[Cells, Cells]:
    """Boxes that are alike but for lying one behind the other along an axis, as one."""
    others = [a for a in range(3) if a != axis]
    order = np.lexsort((first[:, axis], *(last[:, a] for a in others), *(first[:, a] for a in others)))
    first, last = first[order], last[order]
    alike = (first[1:, others] == first[:-1, others]).all(-1) & (last[1:, others] == last[:-1, others]).all(-1)
    touching = first[1:, axis] == last[:-1, axis] + 1
    begins = np.concatenate([[True], ~(alike & touching)])
    ends = np.concatenate([begins[1:], [True]])
    joined = last[ends].copy()
    return first[begins], joined
