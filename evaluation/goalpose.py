"""`roam evaluate goalpose`: do people really sit on objects nobody has seen?

Objects are in canonical form (metres, +Y up, seat facing +Z, floor at their lowest point); `CATALOG.csv` beside them
gives category and seat height, without it both are found from the mesh. Every object is tried from several initial
headings and, once, turned and moved at random, which must not change the pose relative to the object.

    python -m evaluation.goalpose --objects DIR --json FILE [--sheet FILE.png] [--headings 12] [--held-out] …
"""

import argparse
import json
import math
import platform
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import torch
from goalpose.synthesis import Synthesizer
from PIL import Image

from evaluation.goalpose_objects import EvaluationObject, find_objects
from evaluation.goalpose_runs import Plan, Run, evaluate_object, load_synthesizer
from evaluation.goalpose_scores import summarise
from evaluation.picture import contact_sheet

_SYNTHESIZER: Synthesizer | None = None


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate goalpose", description=__doc__.split("\n")[0])
    parser.add_argument("--objects", type=Path, action="append", default=[], help="folder of meshes; repeat for more")
    parser.add_argument("--json", type=Path, help="write all figures here")
    parser.add_argument("--sheet", type=Path, help="write contact sheets here (PNG; numbered when there are several)")
    parser.add_argument("--headings", type=int, default=12, help="initial headings to try each object from")
    parser.add_argument(
        "--held-out", type=Path, action="append", default=[], help="training folder: only what field training left out"
    )
    parser.add_argument("--categories", help="comma-separated, default all but beds")
    parser.add_argument("--limit", type=int, default=0, help="at most so many objects")
    parser.add_argument("--reference", help="reference pose id; default: chosen by fit")
    parser.add_argument("--action", default="sit", choices=("sit", "lie"))
    parser.add_argument("--solver", default="default", choices=("default", "paper"))
    parser.add_argument(
        "--terms", default="all", choices=("all", "descriptor", "geometry"), help="ablation of the energy"
    )
    parser.add_argument("--weights", type=Path, help="field weights; default: the shipped ones")
    parser.add_argument("--turned", type=int, default=1, help="random turns of the upload per object")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    return parser.parse_args(argv)


def _start(plan: Plan) -> None:
    global _SYNTHESIZER
    torch.set_num_threads(1)
    _SYNTHESIZER = load_synthesizer(plan)


def _work(item: tuple[EvaluationObject, Plan]) -> list[Run]:
    assert _SYNTHESIZER is not None
    return evaluate_object(_SYNTHESIZER, *item)


def run_all(objects: list[EvaluationObject], plan: Plan, jobs: int, *, after: Callable[[list[Run]], None]) -> list[Run]:
    """Every object, in order, with a line each on stderr; `after` sees what there is after each, so nothing is lost."""
    runs: list[Run] = []
    with ProcessPoolExecutor(jobs, initializer=_start, initargs=(plan,)) as pool:
        for item, found in zip(objects, pool.map(_work, [(o, plan) for o in objects]), strict=True):
            runs += found
            for run in found[:1]:
                print(f"{item.category:12} {item.name[:46]:46} {run.line()}", file=sys.stderr, flush=True)
            after(runs)
    return runs


def write_sheets(path: Path, runs: list[Run], *, per_sheet: int = 24) -> None:
    """First run of every object, `per_sheet` to a picture."""
    cells = [(run.caption(), run.picture) for run in runs if run.picture is not None]
    for start in range(0, len(cells), per_sheet):
        name = path if len(cells) <= per_sheet else path.with_stem(f"{path.stem}-{start // per_sheet + 1}")
        sheet: Image.Image = contact_sheet(cells[start : start + per_sheet], columns=2)
        name.parent.mkdir(parents=True, exist_ok=True)
        sheet.save(name)


def write_report(options: argparse.Namespace, runs: list[Run], started: float) -> None:
    """All figures so far, when a file was asked for."""
    if not options.json or not runs:
        return
    kept = ("headings", "categories", "reference", "action", "solver", "terms", "turned")
    report = {
        "plan": {name: getattr(options, name) for name in kept},
        "folders": [folder.name for folder in (*options.objects, *options.held_out)],
        "machine": {"system": platform.system(), "processor": platform.machine(), "python": platform.python_version()},
        "minutes": round((time.time() - started) / 60, 1),
        "summary": summarise(runs),
        "runs": [run.record() for run in runs],
    }
    options.json.parent.mkdir(parents=True, exist_ok=True)
    options.json.write_text(json.dumps(report, indent=1) + "\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the evaluation; 0 when it ran, whatever the figures."""
    options = parse(argv)
    categories = set(options.categories.split(",")) if options.categories else None
    objects = find_objects(options.objects, options.held_out, categories=categories)
    objects = objects[: options.limit or None]
    if not objects:
        print("no objects found; give a folder of .glb, .obj, .ply, .stl or .off files", file=sys.stderr)
        return 2
    plan = Plan(
        headings=tuple(2 * math.pi * k / options.headings for k in range(options.headings)),
        turned=options.turned,
        reference=options.reference,
        action=options.action,
        solver=options.solver,
        terms=options.terms,
        weights=options.weights,
        pictures=options.sheet is not None,
    )
    started = time.time()
    runs = run_all(objects, plan, options.jobs, after=lambda runs: write_report(options, runs, started))
    print(json.dumps(summarise(runs), indent=1))
    if options.sheet:
        write_sheets(options.sheet, runs)
    return 0


if __name__ == "__main__":
    np.seterr(all="raise", under="ignore")
    raise SystemExit(main())
