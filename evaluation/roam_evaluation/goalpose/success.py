"""`roam evaluate goalpose`: do people really sit on objects nobody has seen?

Objects are in canonical form (metres, +Y up, seat facing +Z, floor at their lowest point); `CATALOG.csv` beside them
gives category and seat height, without it both are found from the mesh. Every object is tried from several initial
headings and, once, turned and moved at random, which must not change the pose relative to the object.

    roam evaluate goalpose --objects DIR --json FILE [--sheet FILE.png] [--headings 12] [--held-out DIR] …

Further studies, each with options of its own: `roam evaluate goalpose STUDY`, STUDY one of
robustness, distance, ablation, solvers, physics, lie, categories.
"""

import argparse
import importlib
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

from roam_goalpose.energy.terms import TERMS
from roam_goalpose.energy.weights import EnergyWeights
from roam_goalpose.solvers.staged import SolverConfig
from roam_goalpose.synthesis import GoalPoseRequest, Synthesizer, SynthesizerSettings

from roam_evaluation.goalpose.figures.sheet import write_sheets
from roam_evaluation.goalpose.inputs.cases import plain_case, turned_case
from roam_evaluation.goalpose.inputs.objects import EvaluationObject, add_object_options, chosen_objects
from roam_evaluation.goalpose.runs import run_case
from roam_evaluation.goalpose.scores import summarise
from roam_evaluation.goalpose.study import run_study
from roam_evaluation.shared.ledger import Ledger, Record

STUDIES = ("robustness", "distance", "ablation", "solvers", "physics", "lie", "categories")


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What to ask for every object."""

    headings: int
    turned: int
    reference: str | None
    action: str
    solver: str
    terms: str
    weights: Path | None


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="roam evaluate goalpose",
        description=__doc__.split("\n")[0],
        epilog=f"Further studies, as the first word: {', '.join(STUDIES)}; each has its own --help.",
    )
    add_object_options(parser)
    parser.add_argument("--json", type=Path, help="keep all figures here; an interrupted run goes on from it")
    parser.add_argument("--sheet", type=Path, help="write contact sheets here (PNG; numbered when there are several)")
    parser.add_argument("--headings", type=int, default=12, help="initial headings to try each object from")
    parser.add_argument("--reference", help="reference pose id; default: chosen by fit")
    parser.add_argument("--action", default="sit", choices=("sit", "lie"))
    parser.add_argument("--solver", default="default", choices=("default", "paper"))
    parser.add_argument(
        "--terms", default="all", metavar="TERMS", help=f"all, paper, geometry, or a list: {', '.join(TERMS)}"
    )
    parser.add_argument("--weights", type=Path, help="field weights; default: the shipped ones")
    parser.add_argument("--turned", type=int, default=1, help="random turns of the upload per object")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--minutes", type=float, help="start no new object after this")
    options = parser.parse_args(argv)
    try:
        terms_of(options.terms)
    except ValueError as error:
        parser.error(f"--terms: {error}")
    return options


def load_synthesizer(plan: Plan) -> Synthesizer:
    """With the plan's weights and terms."""
    made = Synthesizer.load(SynthesizerSettings(weights=plan.weights) if plan.weights else None)
    made.config = replace(made.config, weights=ablated(made.config, plan.terms))
    return made


def terms_of(text: str) -> tuple[str, ...]:
    """The names that `--terms` stands for: all, the paper's, all but the descriptor, or those in a list.

    Raises ValueError for a name that is no term's.
    """
    groups = {
        "all": tuple(TERMS),
        "paper": tuple(name for name, term in TERMS.items() if term.published is not None),
        "geometry": tuple(name for name in TERMS if name != "descriptor"),
    }
    names = groups.get(text, tuple(text.split(",")))
    unknown = [name for name in names if name not in TERMS]
    if unknown:
        raise ValueError(f"no energy term {', '.join(unknown)}; say {', '.join(groups)}, or some of {', '.join(TERMS)}")
    return names


def ablated(config: SolverConfig, terms: str) -> EnergyWeights:
    """The weights of the terms that `--terms` names, the others switched off."""
    return config.weights.only(*terms_of(terms))


def evaluate_object(synthesizer: Synthesizer, item: EvaluationObject, plan: Plan) -> list[Record]:
    """A run per initial heading, the first of them also on turned uploads."""
    case = plain_case(item)
    runs = []
    for k in range(plan.headings):
        request = GoalPoseRequest(
            reference=plan.reference,
            action=plan.action,
            initial_yaw=2 * math.pi * k / plan.headings,
            solver=plan.solver,
        )
        run = run_case(synthesizer, case, request)
        if k == 0 and plan.turned:
            turned = [
                run_case(synthesizer, turned_case(case, seed), request, beside=run) for seed in range(plan.turned)
            ]
            run = replace(run, turn_error=max(other.turn_error or 0.0 for other in turned))
        runs.append(run)
    print(f"{item.category:12} {item.name[:46]:46} {runs[0].line()}", file=sys.stderr, flush=True)
    return [run.record() for run in runs]


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the evaluation; 0 when it ran, whatever the figures."""
    arguments = sys.argv[1:] if argv is None else list(argv)
    if arguments and arguments[0] in STUDIES:
        ran: int = importlib.import_module(f"roam_evaluation.goalpose.{arguments[0]}").main(arguments[1:])
        return ran
    options = parse(arguments)
    objects = chosen_objects(options)
    plan = Plan(**{field.name: getattr(options, field.name) for field in fields(Plan)})
    told = {name: str(value) if isinstance(value, Path) else value for name, value in asdict(plan).items()}
    ledger = Ledger(options.json, told, summarise=summarise, minutes=options.minutes)
    run_study(ledger, objects, evaluate_object, plan, load=load_synthesizer, jobs=options.jobs)
    print(json.dumps(ledger.report()["summary"], indent=1))
    if options.sheet:
        write_sheets(options.sheet, objects, ledger.records)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
