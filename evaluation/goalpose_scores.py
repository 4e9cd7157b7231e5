"""Figures over many runs."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from evaluation.goalpose_runs import Run

SEAT_KINDS = {
    "chairs": ("chair", "armchair", "officechair"),
    "sofas": ("sofa",),
    "stools and benches": ("stool", "barstool", "bench"),
    "loungers": ("lounger",),
    "beds": ("bed",),
    "unknown": ("unknown",),
}


def summarise(runs: list[Run]) -> dict[str, Any]:
    """Figures for everything and for each kind of seat."""
    found: dict[str, Any] = {"all": figures(runs)} if runs else {}
    for kind, categories in SEAT_KINDS.items():
        chosen = [run for run in runs if run.category in categories]
        if chosen:
            found[kind] = figures(chosen)
    return found


def figures(runs: list[Run]) -> dict[str, Any]:
    """Shares, medians and worst cases of some runs."""
    objects = {run.object for run in runs}
    steady = [o for o in objects if all(run.success for run in runs if run.object == o)]
    return {
        "objects": len(objects),
        "runs": len(runs),
        "success": _share(run.success for run in runs),
        "success_from_every_heading": round(len(steady) / len(objects), 4),
        "strict": _share(run.strict for run in runs),
        "hip_distance_m": _spread(run.hip_distance for run in runs),
        "heading_error_deg": _spread(
            None if run.heading_error is None else np.degrees(run.heading_error) for run in runs
        ),
        "lateral_m": _spread(run.lateral for run in runs),
        "penetration_m": _spread(run.penetration for run in runs),
        "shallower_than_3cm": _share(run.penetration <= 0.03 for run in runs),
        "shallower_than_5cm": _share(run.penetration <= 0.05 for run in runs),
        "floor_m": _spread(run.floor for run in runs),
        "turn_error_m": _spread(run.turn_error for run in runs),
        "turned_within_1cm": _share(run.turn_error <= 0.01 for run in runs if run.turn_error is not None),
        "seconds": _spread(run.seconds for run in runs),
        "cpu_seconds": _spread(run.cpu_seconds for run in runs),
    }


def _share(values: Iterable[bool]) -> float | None:
    found = list(values)
    return round(sum(found) / len(found), 4) if found else None


def _spread(values: Iterable[float | None]) -> dict[str, float] | None:
    found = np.array([v for v in values if v is not None])
    if not len(found):
        return None
    marks = {"median": 50, "p90": 90, "p95": 95, "worst": 100}
    return {name: round(float(np.percentile(found, p)), 4) for name, p in marks.items()}
