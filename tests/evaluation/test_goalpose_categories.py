"""Specialists and the joint field are compared category by category."""

import math

from roam_evaluation.goalpose.categories import MODELS, SPECIALISTS, summarise
from roam_goalpose.furniture import CATEGORIES


def record(model: str, category: str, iou: float) -> dict[str, object]:
    about = {"model": model, "shapes": "test", "threshold": 0.0, "minutes": 1.0}
    scores = {"iou": iou, "iou_3cm": iou, "iou_beyond_3cm": None, "front_error": 0.1}
    return {**about, "name": category, "category": category, **scores}


def test_every_category_has_one_specialist_and_the_joint_field_has_them_all() -> None:
    every = [category for categories in SPECIALISTS.values() for category in categories]
    assert len(every) == len(set(every))
    assert set(every) < set(CATEGORIES)
    assert set(MODELS["joint"]) == set(every)


def test_summary_averages_by_group_and_counts_the_good_ones() -> None:
    found = [record("sofas", "sofa", 0.9), record("sofas", "chair", 0.4), record("sofas", "armchair", 0.8)]
    summary = summarise(found)["sofas"]
    assert summary["sofas"] == {"objects": 1, "iou": 0.9, "iou_3cm": 0.9, "front_error": 0.1, "good": 1.0}
    assert math.isclose(summary["chairs"]["iou_3cm"] or 0.0, 0.6)
    assert summary["chairs"]["good"] == 0.5
    assert summary["all"]["objects"] == 3
    assert summary["beds"] == {"good": None}
