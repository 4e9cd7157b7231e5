"""The rule for table tops is data, and its fit finds the limits that tell tops apart."""

import pytest
from roam_goalpose.assessment.diagnostics import TableLike
from roam_goalpose.training.table_like import TABLES, Sample, fitted, score, table_mesh


def top(breadth: float, length: float, *, table: bool, height: float = 0.45) -> Sample:
    return Sample("top", table, {"seat_breadth": breadth, "seat_length": length, "seat_height": height})


def test_the_shipped_limits_tell_a_dining_table_from_a_stool():
    assert TableLike.load().holds(top(0.8, 1.0, table=True).values)
    assert not TableLike.load().holds(top(0.36, 0.4, table=False).values)


def test_the_fit_moves_limits_to_where_the_tops_differ():
    found = [top(0.50, 0.6, table=True), top(0.48, 0.62, table=True), top(0.40, 0.5, table=False)]
    start = TableLike(broad=0.60, long=0.9, deep=0.5, low=0.3, low_depth=0.3)
    rule = fitted(found, start)
    assert score(start, found) == 0.0
    assert score(rule, found) == 1.0


@pytest.mark.parametrize("kind", TABLES)
def test_tables_stand_on_the_floor_in_sizes_of_their_kind(kind):
    low, high = table_mesh(kind, 3).bounds
    assert low[1] == pytest.approx(0.0, abs=1e-6)
    (shortest, longest), _, (lowest, highest) = TABLES[kind]
    assert shortest <= high[0] - low[0] <= longest
    assert lowest <= high[1] <= highest
