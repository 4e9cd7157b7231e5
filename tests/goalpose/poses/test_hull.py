"""The hull of places on the floor, against scipy's."""

import numpy as np
import pytest
from roam_goalpose.assessment.hull import breadth, hull
from scipy.spatial import ConvexHull


@pytest.mark.parametrize("seed", range(20))
def test_the_breadth_is_that_of_scipys_hull(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.round(rng.normal(size=(int(rng.integers(5, 400)), 2)), int(rng.integers(1, 4)))
    known = ConvexHull(points)
    widths = np.ptp(points[known.vertices] @ known.equations[:, :2].T, axis=0)
    assert breadth(points) == pytest.approx(widths.min(), abs=1e-9)
    assert {tuple(p) for p in hull(points)} == {tuple(p) for p in points[known.vertices]}


@pytest.mark.parametrize("points", [np.zeros((0, 2)), np.ones((5, 2)), np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])])
def test_points_along_a_line_have_no_breadth(points: np.ndarray) -> None:
    assert breadth(points) == 0.0
