"""What an object covers of the floor: outlines that nobody can walk through."""

import numpy as np
import numpy.typing as npt
import shapely

_CELL = 0.04  # [m] side of the squares that hold surface samples
_GAP = 0.10  # [m] narrower gaps are closed
_DETAIL = 0.02  # [m] smaller bends of an outline are straightened


def footprint(points: npt.NDArray[np.floating]) -> list[npt.NDArray[np.float64]]:
    """Corners [K, 2] (x, z) of every separate outline around surface samples [N, 3] [m]; holes are filled."""
    low = _cells(np.floor(points[:, [0, 2]] / _CELL)) * _CELL
    squares = shapely.box(low[:, 0], low[:, 1], low[:, 0] + _CELL, low[:, 1] + _CELL)
    # Squares reach half their side too far on average.
    covered = shapely.coverage_union_all(squares).buffer(_GAP / 2).buffer(-_GAP / 2 - _CELL / 2)
    outlines = shapely.get_parts(covered.simplify(_DETAIL))
    return [shapely.get_coordinates(outline.exterior)[:-1] for outline in outlines if not outline.is_empty]


def _cells(corners: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    """Every row of whole numbers [N, 2] once, in order."""
    first = corners.min(0)
    x, z = (corners - first).astype(np.int64).T
    width = int(z.max()) + 1
    rows = np.divmod(np.unique(x * width + z), width)
    return np.stack(rows, axis=-1).astype(corners.dtype) + first
