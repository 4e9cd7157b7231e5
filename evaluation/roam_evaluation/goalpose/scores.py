"""Figures over many runs."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from roam_goalpose.furniture import TABLE

from roam_evaluation.goalpose.runs import Run, runs_from

SEAT_KINDS: dict[str, tuple[str, ...]] = {
    group: tuple(row.name for row in TABLE.values() if row.group == group)
    for group in dict.fromkeys(row.group for row in TABLE.values())
} | {"unknown": ("unknown",)}
DEPTHS = tuple(round(0.005 * k, 3) for k in range(21))  # [m] t = 0 … 10 cm


def summarise(records: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Figures for everything, for real meshes alone where some are generated, and for each kind of seat."""
    runs = runs_from(records)
    found: dict[str, Any] = {"all": figures(runs)} if runs else {}
    real = [run for run in runs if run.subtype != "generated"]
    if real and len(real) < len(runs):
        found["real meshes"] = figures(real)
    for kind, categories in SEAT_KINDS.items():
        chosen = [run for run in runs if run.category in categories]
        if chosen:
            found[kind] = figures(chosen)
    return found


def summarise_variants(records: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Figures for every variant, in the order of their first run."""
    runs = runs_from(records)
    return {
        variant: figures([r for r in runs if r.variant == variant])
        for variant in dict.fromkeys(r.variant for r in runs)
    }


def figures(runs: list[Run]) -> dict[str, Any]:
    """Shares, medians and worst cases of some runs."""
    objects = {run.object for run in runs}
    steady = [o for o in objects if all(run.success for run in runs if run.object == o)]
    curve = penetration_curve(runs)
    return {
        "objects": len(objects),
        "runs": len(runs),
        "success": share(run.success for run in runs),
        "success_from_every_heading": round(len(steady) / len(objects), 4),
        "strict": share(run.strict for run in runs),
        "strict_with_feet_on_any_floor": share(run.strict_flat for run in runs),
        "hip_distance_m": spread_of(run.hip_distance for run in runs),
        "heading_error_deg": spread_of(
            None if run.heading_error is None else np.degrees(run.heading_error) for run in runs
        ),
        "lateral_m": spread_of(run.lateral for run in runs),
        "penetration_m": spread_of(run.penetration for run in runs),
        "penetration_curve": {str(t): share for t, share in zip(DEPTHS, curve, strict=True)},
        "penetration_auc": area(curve),
        "floor_m": spread_of(run.floor for run in runs),
        "floor_without_hanging_m": spread_of(
            None if run.floor is None else max(0.0, run.floor - run.hang) for run in runs
        ),
        "turn_error_m": spread_of(run.turn_error for run in runs),
        "turned_within_1cm": share(run.turn_error <= 0.01 for run in runs if run.turn_error is not None),
        "warned": share(bool(run.warnings) for run in runs),
        "energy": spread_of(run.energies["total"] for run in runs),
        "seconds": spread_of(run.seconds for run in runs),
        "cpu_seconds": spread_of(run.cpu_seconds for run in runs),
    }


def penetration_curve(runs: list[Run]) -> list[float]:
    """Share of poses without a capsule deeper than t, for every t of DEPTHS."""
    depths = np.array([run.penetration for run in runs])
    return [round(float((depths <= t).mean()), 4) for t in DEPTHS]


def area(curve: list[float]) -> float:
    """Area under a curve over evenly spaced thresholds, as a share of the best possible."""
    return round(float(np.trapezoid(curve) / (len(curve) - 1)), 4)


def share(values: Iterable[bool]) -> float | None:
    """How many of the values are true, of 1; None without values."""
    found = list(values)
    return round(sum(found) / len(found), 4) if found else None


def spread_of(values: Iterable[float | None]) -> dict[str, float] | None:
    """Median and upper percentiles of the values that are known; None without any."""
    found = np.array([v for v in values if v is not None])
    if not len(found):
        return None
    marks = {"median": 50, "p90": 90, "p95": 95, "worst": 100}
    return {name: round(float(np.percentile(found, p)), 4) for name, p in marks.items()}
