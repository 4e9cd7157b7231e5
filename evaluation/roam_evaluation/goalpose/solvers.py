"""`roam evaluate goalpose solvers`: the published schedule against the default, on the same objects in one run.

    roam evaluate goalpose solvers --objects DIR --json FILE [--limit 8] [--minutes 20]

Three ways to a pose, with the reference that the default chooses: the default; the default's search and steps on the
paper's energy; the paper's 500 Adam steps on the paper's energy from the paper's start. All three poses are then
measured with both energies. Seconds are processor time of one thread, measured side by side.
"""

import argparse
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from roam_goalpose.energy.objective import Objective
from roam_goalpose.energy.scene import Settings, Target
from roam_goalpose.energy.terms import published_weights
from roam_goalpose.objects import Shape
from roam_goalpose.synthesis import ENCODER_POINTS, GoalPoseRequest, Synthesizer

from roam_evaluation.goalpose.inputs.cases import plain_case
from roam_evaluation.goalpose.inputs.objects import EvaluationObject, add_object_options, chosen_objects
from roam_evaluation.goalpose.runs import Run, figure_of_pose, run_case, runs_from
from roam_evaluation.goalpose.scores import figures
from roam_evaluation.goalpose.study import run_study, shipped
from roam_evaluation.shared.ledger import Ledger, Record

DEFAULT, PAPER_ENERGY, PAPER = "default", "default on the paper's energy", "paper"
OURS, PUBLISHED = "our energy", "the paper's energy"


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate goalpose solvers", description=__doc__.split("\n")[0])
    add_object_options(parser)
    parser.add_argument("--json", type=Path, help="keep all figures here; an interrupted run goes on from it")
    parser.add_argument("--minutes", type=float, help="start no new object after this")
    return parser.parse_args(argv)


def on_paper_energy(synthesizer: Synthesizer) -> Synthesizer:
    """The default solver with the published terms and weights."""
    config = replace(synthesizer.config, weights=published_weights())
    return Synthesizer(synthesizer.field, synthesizer.references, synthesizer.field_name, config)


def evaluate_object(synthesizer: Synthesizer, item: EvaluationObject, published: Synthesizer) -> list[Record]:
    """The three runs, each with both energies of its pose."""
    case = plain_case(item)
    first = run_case(synthesizer, case, GoalPoseRequest(), variant=DEFAULT)
    request = GoalPoseRequest(reference=first.reference)
    fixed = run_case(synthesizer, case, request, variant=DEFAULT)
    second = run_case(published, case, request, variant=PAPER_ENERGY)
    third = run_case(synthesizer, case, replace(request, solver="paper"), variant=PAPER)
    print(f"{item.category:12} {item.name[:46]:46} {fixed.line()} | {third.line()}", file=sys.stderr, flush=True)
    return [run.record() | both_energies(synthesizer, case.truth, run) for run in (fixed, second, third)]


def both_energies(synthesizer: Synthesizer, shape: Shape, run: Run) -> Record:
    """The pose measured with our energy and with the paper's, at the paper's number of probes."""
    samples = synthesizer.paper.samples
    model = synthesizer.model(synthesizer.references[run.reference], 0, samples)
    figure = figure_of_pose(run.pose)
    found = {}
    with torch.no_grad():
        latent = synthesizer.field.encode(torch.as_tensor(shape.points[:ENCODER_POINTS])[None])
        front = torch.tensor(shape.front, dtype=torch.float32)
        target = Target(synthesizer.field, latent, shape.distance, shape.floor_height, front)
        for name, settings in (
            (OURS, Settings(synthesizer.config.weights, samples)),
            (PUBLISHED, Settings(published_weights(), samples, by_nearness=False)),
        ):
            found[name] = round(float(Objective(model, target, settings).at(figure).energy[0]), 5)
    return found


def compare(records: Iterable[Record]) -> Record:
    """Figures per way, and every way's energies and seconds as ratios to the paper's, object by object."""
    kept = list(records)
    paper = {record["object"]: record for record in kept if record["variant"] == PAPER}
    found: Record = {}
    for way in (DEFAULT, PAPER_ENERGY, PAPER):
        chosen = [record for record in kept if record["variant"] == way and record["object"] in paper]
        ratios = {
            name: _median([record[name] / paper[record["object"]][name] for record in chosen])
            for name in (OURS, PUBLISHED, "cpu_seconds")
        }
        found[way] = {"median_ratio_to_paper": ratios, "poses": figures(runs_from(chosen))}
    return found


def _median(values: list[float]) -> float:
    return round(float(np.median(values)), 4)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the study; 0 when it ran, whatever the figures."""
    options = parse(argv)
    ledger = Ledger(options.json, {"ways": [DEFAULT, PAPER_ENERGY, PAPER]}, summarise=compare, minutes=options.minutes)
    synthesizer = shipped(None)
    published = on_paper_energy(synthesizer)
    run_study(ledger, chosen_objects(options), evaluate_object, published, load=lambda _: synthesizer)
    for way, values in ledger.report()["summary"].items():
        poses, ratios = values["poses"], values["median_ratio_to_paper"]
        print(
            f"{way:32} success {100 * poses['success']:5.1f} %  strict {100 * poses['strict']:5.1f} %  "
            f"CPU {poses['cpu_seconds']['median']:6.2f} s  ratios {ratios}"
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
