import math
from itertools import pairwise

import pytest
from roam_motion.control.paths import edge, way
from shapely.geometry import LineString, Polygon


def box(x, z, width, depth):
    a, b = width / 2, depth / 2
    return ((x - a, z - b), (x + a, z - b), (x + a, z + b), (x - a, z + b))


CHAIR = box(0.0, 0.0, 0.5, 0.5)
STAND, OPEN = (0.0, 0.45), (0.0, 1.0)


def length(corners):
    return sum(math.dist(a, b) for a, b in pairwise(corners))


@pytest.mark.parametrize("angle", range(0, 360, 30))
def test_a_way_from_any_side_ends_before_the_seat_and_keeps_off_the_chair(angle):
    start = (3 * math.sin(math.radians(angle)), 3 * math.cos(math.radians(angle)))
    found = way(start, STAND, OPEN, (CHAIR,))
    assert (found[0], found[-1]) == (start, STAND)
    assert LineString(found).distance(Polygon(CHAIR)) > 0.19
    assert length(found) < math.dist(start, STAND) + 1.1


def test_the_way_goes_between_furniture_and_squeezes_only_where_it_must():
    shelf = box(0.0, 3.0, 4.0, 0.4)
    far = way((0.0, 5.0), STAND, OPEN, (CHAIR, shelf))
    assert LineString(far).distance(Polygon(shelf)) > 0.3
    assert max(abs(x) for x, _ in far) > 2.2
    walls = (box(-2.3, 3.0, 4.0, 0.4), box(2.3, 3.0, 4.0, 0.4))  # a gap of 0.6 m, and ways round of 4 m more
    room = (*walls, box(-4.4, 0.0, 0.2, 7.0), box(4.4, 0.0, 0.2, 7.0), box(0.0, -3.4, 9.0, 0.2))
    through = way((0.0, 5.0), STAND, OPEN, (CHAIR, *room))
    assert max(abs(x) for x, _ in through) < 0.5


def test_a_seat_under_a_table_is_reached_from_the_side():
    table = box(0.0, 1.25, 1.4, 0.9)
    found = way((0.0, 4.0), STAND, OPEN, (CHAIR, table))
    assert LineString(found).distance(Polygon(table)) > 0.1
    assert LineString(found).distance(Polygon(CHAIR)) > 0.1


def test_a_start_inside_furniture_comes_out_and_walled_in_seats_are_walked_to_straight():
    found = way((0.0, -0.1), STAND, OPEN, (CHAIR,))
    assert found[0] == (0.0, -0.1)
    assert found[-1] == STAND
    ring = [box(0, 1.5, 3.2, 0.2), box(0, -1.5, 3.2, 0.2), box(1.5, 0, 0.2, 3.2), box(-1.5, 0, 0.2, 3.2)]
    assert way((4.0, 0.0), STAND, OPEN, tuple(ring)) == ((4.0, 0.0), STAND)


def test_the_edge_is_that_of_the_furniture_under_the_hips():
    table = box(0.0, 0.9, 1.0, 0.4)
    assert edge((0.0, 0.0), OPEN, (CHAIR, table)) == pytest.approx(0.25)
    assert edge((3.0, 0.0), OPEN, (CHAIR, table)) == 0.0
