import numpy as np
import shapely
from roam_goalpose.objects.footprint import footprint
from shapely.geometry import Point, Polygon


def filled(x0, x1, z0, z1, count=4000, seed=0):
    """Points [N, 3] on a slab at seat height."""
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(x0, x1, count), np.full(count, 0.45), rng.uniform(z0, z1, count)], 1)


def test_a_seat_has_one_outline_of_its_size():
    (outline,) = footprint(filled(-0.3, 0.3, -0.2, 0.4))
    np.testing.assert_allclose(outline.min(0), [-0.3, -0.2], atol=0.03)
    np.testing.assert_allclose(outline.max(0), [0.3, 0.4], atol=0.03)
    assert len(outline) < 20
    assert Polygon(outline).is_valid


def test_the_inner_corner_of_a_corner_sofa_stays_free():
    sofa = np.concatenate([filled(-1.2, 1.2, -1.0, -0.2), filled(-1.2, -0.4, -1.0, 1.0, seed=1)])
    (outline,) = footprint(sofa)
    assert Polygon(outline).contains(Point(-0.8, 0.8))
    assert Polygon(outline).distance(Point(0.5, 0.5)) > 0.5


def test_pieces_that_stand_apart_have_outlines_of_their_own():
    chairs = np.concatenate([filled(0, 0.4, 0, 0.4), filled(2, 2.4, 0, 0.4)])
    areas = [Polygon(outline).area for outline in footprint(chairs)]
    assert len(areas) == 2
    assert max(areas) < 0.2
    assert shapely.is_valid([Polygon(outline) for outline in footprint(chairs)]).all()
