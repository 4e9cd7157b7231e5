"""`roam evaluate motion`: do characters reach goal poses on objects nobody has seen, without jumps and sliding feet?

Goal poses are synthesised on the objects of a folder; each is approached from several starts, 2-4 m away (paper, 4.2).

    python -m roam_evaluation.motion.approaches --objects DIR --json FILE [--sheet FILE.png] [--approaches 100] …

Further studies, with options of their own: `roam evaluate motion ablation`, and `roam evaluate motion --people`, the
product's motion beside captured people's.
"""

import argparse
import importlib
import json
import math
import platform
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from roam_motion.animation.blending import Blending
from roam_motion.animation.figure import Figure, humanoid_figure
from roam_motion.animator import Animator, Steer
from roam_serving.shipped import WEIGHTS

from roam_evaluation.goalpose.inputs.objects import find_objects
from roam_evaluation.motion import gait as motion_gait
from roam_evaluation.motion.clips import features_of, read_tracks
from roam_evaluation.motion.goals import SeatGoal, make_goals
from roam_evaluation.motion.measures import Track, frechet, motion_figures
from roam_evaluation.motion.runs import REACHED, Approach, Take, draw_starts, judge, run
from roam_evaluation.shared.sheets import contact_sheet, top_view

SHIPPED = WEIGHTS / "motion.safetensors"
_BATCH = 16
STUDIES = ("ablation",)
FRAMES = {"sit": 300, "lie": 450}  # of an approach


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate motion", description=(__doc__ or "").split("\n")[0])
    parser.add_argument(
        "--objects", type=Path, action="append", required=True, help="folder of meshes; repeat for more"
    )
    parser.add_argument("--json", type=Path, help="write all figures here")
    parser.add_argument("--sheet", type=Path, help="write a contact sheet of the first takes here (PNG)")
    parser.add_argument("--approaches", type=int, default=50)
    parser.add_argument("--categories", help="comma-separated, default all but beds")
    parser.add_argument("--spread", type=float, default=60.0, help="degrees from the front that starts are within")
    parser.add_argument("--action", default="sit", choices=("sit", "lie"))
    parser.add_argument("--limit", type=int, default=0, help="at most so many objects")
    parser.add_argument("--poses", type=Path, help="folder where synthesised goal poses are remembered")
    parser.add_argument("--weights", type=Path, default=SHIPPED)
    parser.add_argument(
        "--without", choices=("settling", "blending"), help="switch off the drawing onto the goal, or all blending"
    )
    parser.add_argument("--clips", type=Path, action="append", help="BVH folder to compare with (repeatable)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--speed", action="store_true", help="also measure the time of a step")
    return parser.parse_args(argv)


def summarise(runs: list[Approach]) -> dict[str, float]:
    """The figures of issues 2 and 4 that need a goal, centimetres and percent."""

    def mean(values: Sequence[float] | np.ndarray) -> float:
        return round(float(np.mean(values)), 3) if len(values) else math.nan

    depths = np.array([r.depth for r in runs])
    own = np.array([r.goal_depth for r in runs])
    times = [r.reached for r in runs if r.reached is not None]
    return {
        "approaches": len(runs),
        "reached_percent": mean([100.0 * (r.mean <= REACHED) for r in runs]),
        "hip_cm": mean([100 * r.hip for r in runs]),
        "hands_cm": mean([100 * r.hands for r in runs]),
        "mean_joint_cm": mean([100 * r.mean for r in runs]),
        "mean_joint_median_cm": round(100 * float(np.median([r.mean for r in runs])), 3),
        "held_cm": mean([100 * r.held for r in runs]),
        "frames_to_goal_mean": mean(times),
        "frames_to_goal_max": max(times, default=0),
        "lowest_joint_cm": round(100 * min(r.lowest for r in runs), 2),
        "depth_median_cm": round(100 * float(np.median(depths)), 2),
        "depth_p95_cm": round(100 * float(np.quantile(depths, 0.95)), 2),
        "goal_depth_median_cm": round(100 * float(np.median(own)), 2),
        "within_3_cm_percent": mean(100.0 * (depths <= 0.03)),
        "within_3_cm_or_goal_percent": mean(100.0 * (depths <= np.maximum(0.03, own))),
        "leaving_depth_p95_cm": round(100 * float(np.quantile([r.leaving_depth for r in runs], 0.95)), 2),
        "stood_percent": mean([100.0 * (r.stood is not None) for r in runs]),
        "frames_to_stand_mean": mean([r.stood for r in runs if r.stood is not None]),
        "frames_to_stand_max": max([r.stood for r in runs if r.stood is not None], default=0),
    }


def grouped(runs: list[Approach]) -> dict[str, dict[str, float]]:
    """Summaries of all approaches, and of those to chairs (and stools, benches) and to sofas apart."""
    sofas = [r for r in runs if r.category == "sofa"]
    others = [r for r in runs if r.category != "sofa"]
    groups = {"all": runs, "chairs": others, "sofas": sofas}
    return {name: summarise(group) for name, group in groups.items() if group}


def beside_clips(figure: Figure, takes: Sequence[Track], folders: Sequence[Path]) -> dict[str, object]:
    """The same measures of captured people, and how far made and other real walking are from held-out walking."""
    held_out, kept = read_tracks(figure, folders)
    real = features_of(figure, held_out)
    return {
        "held_out_clips": motion_figures(figure, held_out),
        "walking_frechet_to_held_out": round(frechet(features_of(figure, takes), real), 2),
        "walking_frechet_of_training_clips": round(frechet(features_of(figure, kept), real), 2),
        "steady_walking": motion_gait.beside(figure, takes, held_out, kept),
    }


def step_time(animator: Animator, count: int, frames: int = 60) -> dict[str, float]:
    """Milliseconds per step of `count` walking characters: median and best wall time, mean processor time."""
    states = [animator.start((float(i), 0.0), 0.0, i) for i in range(count)]
    wishes = [Steer(np.array([0.0, 1.0]))] * count
    walls, before = [], 0.0
    for t in range(frames + 5):
        if t == 5:
            before = time.process_time()
        begin = time.perf_counter()
        states = [state for state, _ in animator.step(states, wishes)]
        walls.append(1000 * (time.perf_counter() - begin))
    spent = 1000 * (time.process_time() - before) / frames
    return {
        "median": round(float(np.median(walls[5:])), 2),
        "best": round(min(walls[5:]), 2),
        "processor": round(spent, 2),
    }


def write_sheets(path: Path, takes: list[Take]) -> None:
    """Side and front views, and a view from above beside them."""
    figure = humanoid_figure()
    motions, goals, roots, headings, ends = {}, {}, {}, {}, {}
    for number, take in enumerate(takes[:4]):
        title = f"{number} {take.goal.name[:28]}"
        frame = figure.frame(torch.tensor(take.goal.pose.positions())[None])
        motions[title] = (
            frame.points_in(torch.tensor(take.positions.reshape(1, -1, 3))).numpy().reshape(take.positions.shape)
        )
        goals[title] = frame.points_in(torch.tensor(take.goal.pose.positions())[None])[0].numpy()
        roots[title] = motions[title][:, 0, [0, 2]]
        headings[title] = figure.facing(torch.tensor(motions[title])).numpy()
        ends[title] = np.array([*goals[title][0, [0, 2]], 0.0, 1.0])
    skeleton = figure.skeleton
    contact_sheet(path, motions, skeleton.parents, skeleton.joint_names, goals=goals, columns=18)
    top_view(path.with_stem(f"{path.stem}-above"), roots, headings, ends)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the evaluation; 0 when it ran, whatever the figures."""
    arguments = sys.argv[1:] if argv is None else list(argv)
    if arguments and arguments[0] in STUDIES:
        ran: int = importlib.import_module(f"roam_evaluation.motion.{arguments[0]}").main(arguments[1:])
        return ran
    if "--people" in arguments:
        from roam_evaluation.motion.people import evaluate

        return evaluate.main(arguments)
    options = parse(arguments)
    torch.set_num_threads(1)
    categories = set(options.categories.split(",")) if options.categories else None
    objects = find_objects(options.objects, categories=categories, held_out=())[: options.limit or None]
    goals = make_goals(objects, action=options.action, remembered=options.poses)
    if not goals:
        print("no usable objects found; give a folder of .glb, .obj, .ply, .stl or .off files")
        return 2
    parts = Blending(inverse=options.without != "blending", settling=options.without is None)
    animator = Animator.load(options.weights, parts)
    takes = approach(animator, goals, options)
    report = {"objects": len(goals), **judged(animator, takes, options)}
    print(json.dumps({k: v for k, v in report.items() if k != "runs"}, indent=1))
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(report, indent=1) + "\n")
    if options.sheet:
        write_sheets(options.sheet, takes)
    return 0


def approach(animator: Animator, goals: Sequence[SeatGoal], options: argparse.Namespace) -> list[Take]:
    """All approaches, goal after goal, in batches."""
    chosen = [goals[i % len(goals)] for i in range(options.approaches)]
    starts = draw_starts(chosen, spread=math.radians(options.spread), seed=options.seed)
    takes: list[Take] = []
    for i in range(0, len(chosen), _BATCH):
        takes += run(animator, chosen[i : i + _BATCH], starts[i : i + _BATCH], frames=FRAMES[options.action])
    return takes


def judged(animator: Animator, takes: list[Take], options: argparse.Namespace) -> dict[str, object]:
    """All figures of the takes."""
    frames = FRAMES[options.action]
    runs = [judge(animator.figure, take, frames=frames) for take in takes]
    report: dict[str, object] = {
        "action": options.action,
        "frames": frames,
        "starts": f"2-4 m away, within {options.spread:g} degrees of the front, heading within 30 degrees",
        "without": options.without,
        "machine": {"system": platform.system(), "processor": platform.machine(), "python": platform.python_version()},
        "summary": grouped(runs),
        "motion": motion_figures(animator.figure, takes),
        "runs": [asdict(r) for r in runs],
    }
    if options.clips:
        report["beside"] = beside_clips(animator.figure, takes, options.clips)
    if options.speed:
        report["step_ms"] = {str(n): step_time(animator, n) for n in (1, 8, 32)}
    return report


if __name__ == "__main__":
    raise SystemExit(main())
