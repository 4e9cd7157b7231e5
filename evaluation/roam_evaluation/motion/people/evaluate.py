"""`roam evaluate motion --people`: does the product move like people?

The same measures, by the same code, of the product and of captured people that no training saw; then a verdict.

    roam evaluate motion --people --objects DIR [--mocap DIR] [--quick] [--json FILE] [--table FILE.md]
"""

import argparse
import json
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from roam_motion.animator import Animator

from roam_evaluation.goalpose.inputs.objects import find_objects, spread
from roam_evaluation.motion.goals import make_goals
from roam_evaluation.motion.people import performed
from roam_evaluation.motion.people.activities import ACTIVITIES
from roam_evaluation.motion.people.blind import blind_test
from roam_evaluation.motion.people.captured import Captured, cached_captured
from roam_evaluation.motion.people.frames import Motion
from roam_evaluation.motion.people.pictures import SCENES, draw
from roam_evaluation.motion.people.reference import people_samples
from roam_evaluation.motion.people.report import as_json, as_text, blind_table, table, targets_table
from roam_evaluation.motion.people.storage import read_motions, write_motions
from roam_evaluation.motion.people.targets import targets
from roam_evaluation.motion.people.verdict import Verdict, judge, people_range, summary

_ROOT = Path(__file__).parents[4]
SHIPPED = _ROOT / "weights" / "motion.safetensors"
_CACHE = _ROOT / "runs" / "people"
MOCAP = _ROOT.parent / "shared" / "mocap"


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="roam evaluate motion --people", description="measures of the product beside those of captured people"
    )
    parser.add_argument("--people", action="store_true", help="(what brought you here)")
    parser.add_argument("--objects", type=Path, action="append", default=[], help="folder of meshes (repeatable)")
    parser.add_argument("--mocap", type=Path, default=MOCAP, help="motion-capture folder with HELDOUT.txt")
    parser.add_argument("--weights", type=Path, default=SHIPPED)
    parser.add_argument("--poses", type=Path, help="folder where synthesised goal poses are remembered")
    parser.add_argument("--approaches", type=int, help="how many (default 48, quick 10)")
    parser.add_argument("--seeds", type=int, help="of every steered scene (default 12, quick 4)")
    parser.add_argument("--quick", action="store_true", help="fewer of everything: under two minutes on one core")
    parser.add_argument("--only", help="comma-separated activities by key, or pictures by name (default all)")
    parser.add_argument("--no-blind", action="store_true", help="leave the blind test out")
    parser.add_argument("--record", type=Path, help="keep the product's frames here (.npz)")
    parser.add_argument("--recorded", type=Path, help="measure frames kept before, of this or another build")
    parser.add_argument("--beside", type=Path, help="report (.json) of another build, shown in a column of the table")
    parser.add_argument("--build", default="", help="what the report says was measured")
    parser.add_argument("--draw", type=Path, help="draw filmstrips and videos into this folder instead")
    parser.add_argument("--stills", action="store_true", help="with --draw: no videos, which take the longest")
    parser.add_argument("--json", type=Path, help="write all figures here")
    parser.add_argument("--table", type=Path, help="write the readable table here (Markdown)")
    return parser.parse_args(argv)


def perform(options: argparse.Namespace, keys: Sequence[str]) -> list[Motion]:
    """The product's frames of all scenes that the activities need."""
    animator = Animator.load(options.weights)
    seeds = range(options.seeds or (4 if options.quick else 12))
    scenes = []
    if {"walk_0.9", "walk_1.2", "walk_1.5", "start", "stop", "feet", "variety_walk"} & set(keys):
        scenes += performed.steered(performed.WALKS, seeds)
    if "run" in keys:
        scenes += performed.steered(performed.RUNS, seeds)
    if "idle" in keys:
        scenes += performed.standing(seeds)
    if "turn" in keys:
        scenes += performed.on_the_spot(performed.TURNS, seeds)
    motions = performed.perform(animator, scenes)
    if {"walk_approach", "feet", "sit_down", "stand_up", "seated", "variety_sit"} & set(keys):
        motions += approach(animator, options, "sit", options.approaches or (10 if options.quick else 48))
    if "lie_down" in keys:
        motions += approach(animator, options, "lie", max(4, (options.approaches or 16) // 3))
    return motions


def approach(animator: Animator, options: argparse.Namespace, action: str, count: int) -> list[Motion]:
    """Approaches to objects spread over the folders'; beds and sofas to lie on."""
    categories = {"bed", "sofa", "lounger"} if action == "lie" else None
    # Every object twice, with two seeds.
    objects = spread(find_objects(options.objects, held_out=(), categories=categories), (count + 1) // 2)
    goals = make_goals(objects, action=action, remembered=options.poses)
    if not goals:
        print(f"no objects to {action} on; give a folder of furniture with --objects")
        return []
    return performed.approaches(animator, goals, count)


def verdicts(motions: Sequence[Motion], captured: Captured, keys: Sequence[str], mocap: Path) -> list[Verdict]:
    """Every measure of the chosen activities, judged."""
    found: list[Verdict] = []
    for activity in ACTIVITIES:
        if activity.key in keys:
            held_out, training = people_samples(activity, captured, mocap, _CACHE)
            found += judge(activity, activity.made(motions), held_out, training)
    return found


def reported(motions: Sequence[Motion], captured: Captured, options: argparse.Namespace) -> tuple[dict[str, Any], str]:
    """All figures of the product's motions, as a report and as a table to read."""
    keys = _chosen(options) or [activity.key for activity in ACTIVITIES]
    found = verdicts(motions, captured, keys, options.mocap)
    kept = targets(motions, people_range(found, "sit_down", "balance_half_down"))
    told_apart = [] if options.no_blind else blind_test(motions, captured.held_out, captured.training)
    beside = json.loads(options.beside.read_text()) if options.beside else None
    parts = [table(found, ACTIVITIES, beside), targets_table(kept), blind_table(told_apart) if told_apart else ""]
    report = {
        "summary": summary(found),
        "targets": [asdict(target) for target in kept],
        "blind_test": [asdict(blind) for blind in told_apart],
        "machine": {"system": platform.system(), "processor": platform.machine(), "python": platform.python_version()},
        "quick": options.quick,
        "build": options.build,
        "measures": as_json(found),
    }
    return report, "\n\n".join(part for part in parts if part)


def _chosen(options: argparse.Namespace) -> list[str]:
    """The names given with --only. ValueError with the known ones when one is unknown."""
    names = options.only.split(",") if options.only else []
    known = SCENES if options.draw else tuple(activity.key for activity in ACTIVITIES)
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(f"--only does not know {', '.join(unknown)}; it knows {', '.join(known)}")
    return names


def _run(options: argparse.Namespace) -> None:
    """Draws, or measures and writes."""
    chosen = _chosen(options)
    if options.draw:
        people = cached_captured(options.mocap, _CACHE) if options.mocap.exists() else None
        animator = Animator.load(options.weights)
        draw(animator, options.objects, options.poses, options.draw, people, films=not options.stills, only=chosen)
        return
    captured = cached_captured(options.mocap, _CACHE)
    keys = chosen or [activity.key for activity in ACTIVITIES]
    motions = read_motions(options.recorded) if options.recorded else perform(options, keys)
    if options.record:
        write_motions(options.record, motions)
    report, text = reported(motions, captured, options)
    print(text)
    print(json.dumps(report["summary"]))
    for path, content in ((options.json, as_text(report)), (options.table, text)):
        if path:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(content + "\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the evaluation; 0 when it ran, whatever the figures; 2 with advice when it could not."""
    options = parse(argv)
    torch.set_num_threads(1)
    try:
        _run(options)
    except (FileNotFoundError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
