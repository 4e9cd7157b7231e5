"""`roam evaluate goalpose robustness`: what headings, placements, sizes and scans do to the pose (paper Fig. 8).

    roam evaluate goalpose robustness --objects DIR --json FILE [--plot FILE.png] [--limit 20] …

Every object is sent at twelve headings to a person who begins at yaw 0, then turned and moved, with another up axis,
tilted or rotated in any way, too large and too small, and as a scan: noisy, with one side missing, from few or many
points. Poses are judged on the object as it really is.
"""

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from roam_goalpose.objects import ObjectError
from roam_goalpose.synthesis import GoalPoseRequest, Synthesizer

from roam_evaluation.goalpose.figures.plots import plot_bars
from roam_evaluation.goalpose.inputs.cases import (
    Case,
    cloud_case,
    faced_case,
    plain_case,
    scaled_case,
    spun_case,
    tilted_case,
    tumbled_case,
    turned_case,
)
from roam_evaluation.goalpose.inputs.objects import EvaluationObject, add_object_options, chosen_objects
from roam_evaluation.goalpose.runs import Run, run_case
from roam_evaluation.goalpose.scores import summarise_variants
from roam_evaluation.goalpose.study import run_study, shipped
from roam_evaluation.shared.ledger import Ledger, Record

HEADINGS = 12
BACK, SIDE = math.pi, math.pi / 2  # [rad] in the canonical object's space
UPLOADS: dict[str, Callable[[Case], Case]] = {
    "turned 1": partial(turned_case, seed=1),
    "turned 2": partial(turned_case, seed=2),
    "turned, Z up": partial(tumbled_case, seed=3),
    "tilted 1": partial(tilted_case, seed=1),
    "tilted 2": partial(tilted_case, seed=2),
    "any rotation": partial(spun_case, seed=4),
    "size 0.8": partial(scaled_case, factor=0.8),
    "size 0.9": partial(scaled_case, factor=0.9),
    "size 1.1": partial(scaled_case, factor=1.1),
    "size 1.2": partial(scaled_case, factor=1.2),
    "noise 1 cm": partial(cloud_case, count=20_000, noise=0.01),
    "back unseen": partial(cloud_case, count=20_000, hidden_from=BACK),
    "side unseen": partial(cloud_case, count=20_000, hidden_from=SIDE),
    "500 points": partial(cloud_case, count=500),
    "2,000 points": partial(cloud_case, count=2_000),
    "20,000 points": partial(cloud_case, count=20_000),
    "100,000 points": partial(cloud_case, count=100_000),
}


@dataclass(frozen=True)
class Plan:
    """What to ask for every object."""

    headings: int
    uploads: tuple[str, ...]


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate goalpose robustness", description=__doc__.split("\n")[0])
    add_object_options(parser)
    parser.add_argument("--json", type=Path, help="keep all figures here; an interrupted run goes on from it")
    parser.add_argument("--plot", type=Path, help="success against each change (PNG)")
    parser.add_argument(
        "--headings", type=int, default=HEADINGS, help="headings of the upload, the first of them plain"
    )
    parser.add_argument("--uploads", nargs="*", choices=tuple(UPLOADS), default=tuple(UPLOADS), metavar="CHANGE")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--minutes", type=float, help="start no new object after this")
    return parser.parse_args(argv)


def evaluate_object(synthesizer: Synthesizer, item: EvaluationObject, plan: Plan) -> list[Record]:
    """A run per heading and per change of the upload."""
    case = plain_case(item)
    runs = [run_case(synthesizer, case, GoalPoseRequest(initial_yaw=0.0), variant="heading 0")]
    for k in range(1, plan.headings):
        degrees = 360 * k // plan.headings
        faced = faced_case(case, math.radians(degrees))
        request = GoalPoseRequest(initial_yaw=0.0)
        runs.append(run_case(synthesizer, faced, request, variant=f"heading {degrees}", beside=runs[0]))
    for variant in plan.uploads:
        run = _changed(synthesizer, case, variant, UPLOADS[variant], plain=runs[0])
        runs += [] if run is None else [run]
    good = sum(run.success for run in runs)
    print(f"{item.category:12} {item.name[:46]:46} {good} of {len(runs)}", file=sys.stderr, flush=True)
    return [run.record() for run in runs]


def _changed(
    synthesizer: Synthesizer, case: Case, variant: str, change: Callable[[Case], Case], *, plain: Run
) -> Run | None:
    """The run on a changed upload, None when the service refuses it."""
    try:
        changed = change(case)
    except ObjectError as error:
        print(f"{case.item.name}, {variant}: {error}", file=sys.stderr)
        return None
    beside = None if variant.startswith("size") else plain
    return run_case(synthesizer, changed, GoalPoseRequest(initial_yaw=0.0), variant=variant, beside=beside)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the study; 0 when it ran, whatever the figures."""
    options = parse(argv)
    plan = Plan(options.headings, tuple(options.uploads))
    ledger = Ledger(options.json, asdict(plan), summarise=summarise_variants, minutes=options.minutes)
    run_study(ledger, chosen_objects(options), evaluate_object, plan, load=shipped, jobs=options.jobs)
    summary = ledger.report()["summary"]
    for variant, figures in summary.items():
        turn = figures["turn_error_m"] or {"median": math.nan, "p90": math.nan}
        print(
            f"{variant:16} success {100 * figures['success']:5.1f} %  strict {100 * figures['strict']:5.1f} %  "
            f"pose moves {100 * turn['median']:5.1f} cm (p90 {100 * turn['p90']:.1f})  of {figures['runs']}"
        )
    if options.plot:
        plot_bars(options.plot, {v: (f["success"], f["strict"]) for v, f in summary.items()}, ("success", "strict"))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
