"""Figures over many runs."""

import pytest
from roam_evaluation.goalpose.scores import area, figures, penetration_curve, summarise, summarise_variants
from seating import run


def test_penetration_curve_and_its_area():
    curve = penetration_curve([run(penetration=0.0), run(penetration=0.021), run(penetration=0.2)])
    assert curve[0] == pytest.approx(1 / 3, abs=1e-3)
    assert curve[4] == pytest.approx(1 / 3, abs=1e-3)  # 2 cm
    assert curve[5] == pytest.approx(2 / 3, abs=1e-3)  # 2.5 cm
    assert curve[-1] == pytest.approx(2 / 3, abs=1e-3)
    assert area([1.0, 1.0, 1.0]) == 1.0
    assert area([0.0, 0.5, 1.0]) == 0.5


def test_objects_that_fail_from_one_heading_are_not_steady():
    runs = [run(object="a"), run(object="a", hip_distance=0.5), run(object="b"), run(object="b")]
    found = figures(runs)
    assert (found["objects"], found["runs"]) == (2, 4)
    assert (found["success"], found["success_from_every_heading"]) == (0.75, 0.5)


def test_real_meshes_are_told_apart_from_generated_ones():
    records = [run(hip_distance=0.5).record(), run(object="made", subtype="generated").record()]
    found = summarise(records)
    assert (found["all"]["success"], found["real meshes"]["success"]) == (0.5, 0.0)
    assert found["chairs"]["runs"] == 2


def test_variants_keep_their_order():
    records = [run(variant=v).record() for v in ("plain", "larger", "plain")]
    assert [(v, f["runs"]) for v, f in summarise_variants(records).items()] == [("plain", 2), ("larger", 1)]
