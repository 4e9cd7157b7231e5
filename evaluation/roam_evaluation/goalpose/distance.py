"""`roam evaluate goalpose distance`: how far the pose moves from the reference as the object differs (paper Fig. 7).

    roam evaluate goalpose distance --objects DIR --reference chair_sit --categories chair,armchair --json FILE …

One reference pair is adapted to every object. Both objects stand in canonical form; their difference is the Chamfer
distance of their surfaces, that of the poses the change of root translation, root orientation and of the joints in
the root's frame.
"""

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from roam_character.pose import Pose
from roam_character.rotation import quat_angle, quat_inv, quat_rotate
from roam_goalpose.objects import Shape
from roam_goalpose.references.pairs import ReferencePair
from roam_goalpose.synthesis import GoalPoseRequest, Synthesizer
from scipy.spatial import cKDTree
from scipy.stats import spearmanr

from roam_evaluation.goalpose.figures.plots import plot_distances
from roam_evaluation.goalpose.inputs.cases import plain_case
from roam_evaluation.goalpose.inputs.objects import EvaluationObject, add_object_options, chosen_objects
from roam_evaluation.goalpose.runs import run_case
from roam_evaluation.goalpose.scores import summarise
from roam_evaluation.goalpose.study import run_study, shipped
from roam_evaluation.shared.ledger import Ledger, Record

POINTS = 4000  # of each surface
CHANGES = ("root_translation_m", "root_orientation_deg", "joint_change_m")


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate goalpose distance", description=__doc__.split("\n")[0])
    add_object_options(parser)
    parser.add_argument("--reference", default="chair_sit", help="reference pose id")
    parser.add_argument("--json", type=Path, help="keep all figures here; an interrupted run goes on from it")
    parser.add_argument("--plot", type=Path, help="the three scatter plots (PNG)")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--minutes", type=float, help="start no new object after this")
    return parser.parse_args(argv)


def evaluate_object(synthesizer: Synthesizer, item: EvaluationObject, reference: str) -> list[Record]:
    """One run with its changes."""
    pair = synthesizer.references[reference]
    case = plain_case(item)
    run = run_case(synthesizer, case, GoalPoseRequest(reference=reference))
    print(f"{item.category:12} {item.name[:46]:46} {run.line()}", file=sys.stderr, flush=True)
    apart = {"chamfer_m": round(chamfer(case.truth, pair.shape), 4)}
    return [run.record() | apart | changes(run.pose, pair)]


def chamfer(a: Shape, b: Shape) -> float:
    """Mean distance from each surface to the other, both ways averaged [m]."""
    first, second = a.points[:POINTS], b.points[:POINTS]
    there, back = cKDTree(second).query(first)[0], cKDTree(first).query(second)[0]
    return float((np.mean(there) + np.mean(back)) / 2)


def changes(pose: Pose, pair: ReferencePair) -> dict[str, float]:
    """What differs from the reference pose: root translation, root orientation, joints in the root's frame."""
    apart = np.linalg.norm(pose.root_position - pair.pose.root_position)
    angle = quat_angle(pose.rotations[0], pair.pose.rotations[0])
    joints = np.linalg.norm(_in_root(pose) - _in_root(pair.pose), axis=-1).mean()
    values = (float(apart), float(np.degrees(angle)), float(joints))
    return {name: round(value, 4) for name, value in zip(CHANGES, values, strict=True)}


def _in_root(pose: Pose) -> Any:
    positions = pose.positions()
    turn = np.broadcast_to(quat_inv(pose.rotations[0]), (len(positions), 4))
    return quat_rotate(turn, positions - positions[0])


def trends(records: Iterable[Record]) -> Record:
    """The usual figures, and for every change its spread and its rank correlation with the Chamfer distance."""
    kept = list(records)
    found: Record = {}
    for name in CHANGES:
        values = np.array([record[name] for record in kept])
        rank = spearmanr([record["chamfer_m"] for record in kept], values).statistic if len(kept) > 2 else np.nan
        found[name] = {
            "median": round(float(np.median(values)), 4),
            "p90": round(float(np.percentile(values, 90)), 4),
            "rank_correlation_with_chamfer": None if np.isnan(rank) else round(float(rank), 3),
        }
    return {"changes": found, "poses": summarise(kept)["all"]}


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the study; 0 when it ran, whatever the figures."""
    options = parse(argv)
    ledger = Ledger(options.json, {"reference": options.reference}, summarise=trends, minutes=options.minutes)
    objects = chosen_objects(options)
    run_study(ledger, objects, evaluate_object, options.reference, load=shipped, jobs=options.jobs)
    summary = ledger.report()["summary"]
    for name, values in summary.get("changes", {}).items():
        print(f"{name:22} {values}")
    if options.plot:
        plot_distances(options.plot, ledger.records, CHANGES)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
