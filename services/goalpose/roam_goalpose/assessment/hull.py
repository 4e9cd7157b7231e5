"""The convex hull of places on the floor: scipy's, which would be all that an answer needs of scipy, takes as long to
import as the pose to solve."""

import numpy as np
import numpy.typing as npt

Places = npt.NDArray[np.float64]  # [K, 2]


def hull(points: Places) -> Places:
    """Its corners `[C, 2]` in order, counter-clockwise from the least; fewer than 3 of points that lie along a line.

    Andrew's monotone chain (Information Processing Letters 9, 1979).
    """
    rows = sorted(map(tuple, _outermost(points).tolist()))
    return np.array([*_chain(rows), *_chain(rows[::-1])] if len(rows) > 1 else rows).reshape(-1, 2)


def breadth(points: Places) -> float:
    """The least distance of two parallel lines with all points between them [m]; 0 when they lie along one."""
    corners = hull(points)
    if len(corners) < 3:
        return 0.0
    along = np.roll(corners, -1, axis=0) - corners
    normals = along[:, ::-1] * [1.0, -1.0] / np.linalg.norm(along, axis=1, keepdims=True)
    return float(np.ptp(corners @ normals.T, axis=0).min())


def _outermost(points: Places) -> Places:
    """Of points with the same first coordinate those with the least and the greatest second."""
    order = points[np.lexsort((points[:, 1], points[:, 0]))]
    new = np.flatnonzero(np.diff(order[:, 0], prepend=-np.inf) > 0)
    last = np.append(new[1:], len(order)) - 1 if len(new) else new
    return order[np.unique(np.concatenate([new, last]))] if len(order) else order


def _chain(rows: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """The hull's corners on one side, without the last."""
    found: list[tuple[float, ...]] = []
    for row in rows:
        while len(found) > 1 and _turn(found[-2], found[-1], row) <= 1e-12:
            found.pop()
        found.append(row)
    return found[:-1]


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    """Twice the area of a triangle: positive when it turns to the left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
