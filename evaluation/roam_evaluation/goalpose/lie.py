"""`roam evaluate goalpose lie`: do people lie well on beds, sofas and loungers that nobody has seen?

    roam evaluate goalpose lie --objects DIR --held-out DIR --generated 18 --json FILE [--sheet FILE.png]

A success lies on the seat or mattress with pelvis, back and head within 5 cm of what is below or behind them, no
capsule deeper than 3 cm, within 20° of the furniture's long side, or on beds and loungers that have a head board, with
the head there. What is no success
should be refused by the answer itself; *silent* counts those that are not.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from roam_goalpose.objects import load_shape
from roam_goalpose.synthesis import GoalPoseRequest, Synthesizer

from roam_evaluation.goalpose.figures.sheet import write_sheets
from roam_evaluation.goalpose.inputs.objects import EvaluationObject, add_object_options, chosen_objects
from roam_evaluation.goalpose.lying import ALONG, GAP, OFF_SEAT, LyingRun, judge_lying, lying_run_from
from roam_evaluation.goalpose.scores import share, spread_of
from roam_evaluation.goalpose.study import run_study, shipped
from roam_evaluation.shared.ledger import Ledger, Record

KINDS = ("bed", "sofa", "lounger")


def evaluate_object(synthesizer: Synthesizer, item: EvaluationObject, plan: None) -> list[Record]:
    """One pose, on the object as it is."""
    shape = load_shape(item.read(), item.format)
    began = time.thread_time()
    result = synthesizer.synthesize(shape, GoalPoseRequest(action="lie"))
    run = judge_lying(item, shape, result, cpu_seconds=time.thread_time() - began)
    print(f"{item.category:8} {item.name[:46]:46} {run.line()}", file=sys.stderr, flush=True)
    return [run.record()]


def summarise(records: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Figures for everything, for real meshes alone, and for each kind of furniture."""
    runs = [lying_run_from(record) for record in records]
    real = [run for run in runs if run.subtype != "generated"]
    groups = {"all": runs, "real meshes": real} | {
        f"{kind}s": [run for run in runs if run.category == kind] for kind in KINDS
    }
    return {name: _figures(group) for name, group in groups.items() if group}


def _figures(runs: list[LyingRun]) -> dict[str, Any]:
    return {
        "objects": len(runs),
        "success": share(run.success for run in runs),
        "refused": share(run.refused for run in runs),
        "refused_successes": share(run.refused and run.success for run in runs),
        "silent": share(not run.success and not run.refused for run in runs),
        "held": share(run.held for run in runs),
        "held_but_the_head": share(max(run.gaps["hips"], run.gaps["chest"]) <= GAP for run in runs),
        "on_the_seat": share(run.off_seat <= OFF_SEAT for run in runs),
        "along": share(run.across <= ALONG for run in runs if run.across is not None),
        "head_at_back": share(run.head_at_back for run in runs if run.head_at_back is not None),
        "head_room_m": spread_of(run.head_room for run in runs),
        "foot_room_m": spread_of(run.foot_room for run in runs),
        "feet_over_the_end": share(run.foot_room < 0 for run in runs),
        "penetration_m": spread_of(run.penetration for run in runs),
        "cpu_seconds": spread_of(run.cpu_seconds for run in runs),
    }


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate goalpose lie", description=__doc__.split("\n")[0])
    add_object_options(parser)
    parser.set_defaults(categories=",".join(KINDS))
    parser.add_argument("--json", type=Path, help="keep all figures here; an interrupted run goes on from it")
    parser.add_argument("--sheet", type=Path, help="write contact sheets here (PNG; numbered when there are several)")
    parser.add_argument("--minutes", type=float, help="start no new object after this")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the study; 0 when it ran, whatever the figures."""
    options = parse(argv)
    objects = chosen_objects(options)
    ledger = Ledger(options.json, {"action": "lie"}, summarise=summarise, minutes=options.minutes)
    run_study(ledger, objects, evaluate_object, None, load=shipped)
    print(json.dumps(ledger.report()["summary"], indent=1))
    if options.sheet:
        write_sheets(options.sheet, objects, ledger.records, read=lying_run_from)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
