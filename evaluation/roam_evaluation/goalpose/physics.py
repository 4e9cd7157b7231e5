"""`roam evaluate goalpose physics`: poses let go under gravity on their objects for a second (paper section D, Fig. 9).

    roam evaluate goalpose physics --poses goalpose.json --objects DIR --json FILE [--plot FILE.png]

Takes the poses that `roam evaluate goalpose --json` kept, the first heading of every object.
"""

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from roam_goalpose.objects import load_shape

from roam_evaluation.goalpose.figures.plots import plot_drift
from roam_evaluation.goalpose.inputs.objects import EvaluationObject, add_object_options, chosen_objects
from roam_evaluation.goalpose.runs import Run, run_from
from roam_evaluation.goalpose.scores import SEAT_KINDS, area
from roam_evaluation.goalpose.simulation.world import MASS, RATE, SAG, drift
from roam_evaluation.shared.ledger import Ledger, Record

THRESHOLDS = tuple(round(0.01 * k, 2) for k in range(31))  # [m]
LIMIT = 0.10  # [m] the largest drift that counts as holding


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate goalpose physics", description=__doc__.split("\n")[0])
    add_object_options(parser)
    parser.add_argument("--poses", type=Path, required=True, help="JSON of `roam evaluate goalpose` on these objects")
    parser.add_argument("--variant", default="plain", help="which of its runs: plain, or a variant of an ablation")
    parser.add_argument("--json", type=Path, help="keep all figures here; an interrupted run goes on from it")
    parser.add_argument("--plot", type=Path, help="success curves (PNG)")
    parser.add_argument("--minutes", type=float, help="start no new object after this")
    return parser.parse_args(argv)


def first_runs(path: Path, variant: str) -> dict[str, Run]:
    """The first run of a variant on every object, from a report."""
    groups = json.loads(path.read_text())["runs"].values()
    chosen = [[run_from(record) for record in group if record["variant"] == variant] for group in groups]
    return {runs[0].object: runs[0] for runs in chosen if runs}


def let_go(item: EvaluationObject, run: Run) -> Record:
    """The record of one simulation."""
    found = drift(run.pose, load_shape(item.read(), item.format))
    print(
        f"{item.name[:46]:46} mean {100 * found.mean:5.1f} cm, largest {100 * found.largest:5.1f} cm", file=sys.stderr
    )
    names = run.pose.skeleton.joint_names
    return {
        "object": item.name,
        "category": item.category,
        "strict": run.strict,
        "mean_m": round(found.mean, 4),
        "largest_m": round(found.largest, 4),
        "hips_m": round(float(found.joints[0]), 4),
        "joints_m": {name: round(float(d), 4) for name, d in zip(names, found.joints, strict=True)},
        "boxes": found.boxes,
    }


def summarise_drift(records: Iterable[Record]) -> Record:
    """Shares below every threshold, for all objects and for each kind."""
    kept = list(records)
    groups = {"all": kept}
    for kind, categories in SEAT_KINDS.items():
        groups[kind] = [record for record in kept if record["category"] in categories]
    return {name: _figures(group) for name, group in groups.items() if group}


def _figures(records: list[Record]) -> Record:
    joints = np.array([list(record["joints_m"].values()) for record in records])
    means, largest = joints.mean(1), joints.max(1)
    per_joint = [round(float((joints <= t).mean()), 4) for t in THRESHOLDS]
    return {
        "poses": len(records),
        "mean_drift_below_10cm": round(float((means < LIMIT).mean()), 4),
        "every_joint_below_10cm": round(float((largest < LIMIT).mean()), 4),
        "joints_below_10cm": round(float((joints < LIMIT).mean()), 4),
        "median_mean_drift_m": round(float(np.median(means)), 4),
        "median_hips_drift_m": round(float(np.median(joints[:, 0])), 4),
        "joint_curve": dict(zip(map(str, THRESHOLDS), per_joint, strict=True)),
        "pose_curve": {str(t): round(float((means <= t).mean()), 4) for t in THRESHOLDS},
        "joint_auc": area(per_joint),
    }


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the study; 0 when it ran, whatever the figures."""
    options = parse(argv)
    runs = first_runs(options.poses, options.variant)
    items = {item.name: item for item in chosen_objects(options) if item.name in runs}
    plan = {"variant": options.variant, "rate": RATE, "mass_kg": MASS, "sag_rad": SAG}
    ledger = Ledger(options.json, plan, summarise=summarise_drift, minutes=options.minutes)
    for name in ledger.pending(items):
        ledger.add(name, [let_go(items[name], runs[name])])
    summary = ledger.report()["summary"]
    print(json.dumps(summary, indent=1))
    if options.plot and summary:
        curves = {label: summary["all"][f"{key}_curve"] for key, label in (("joint", "joints"), ("pose", "pose, mean"))}
        plot_drift(options.plot, {label: (list(map(float, c)), list(c.values())) for label, c in curves.items()})
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
