"""`roam train motion`: from a folder of BVH files to weights.

    roam train motion --bvh DIR [--bvh DIR …] --minutes 90 --out runs/mine [--resume] [--init WEIGHTS]

Without --bvh the project's own motion-capture set is used. Every run writes config.json, curve.jsonl, validation.jsonl,
latest.pt and best.pt to its folder, stops cleanly on SIGINT or SIGTERM, and goes on with --resume.
"""

import argparse
import copy
import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import torch

from roam_motion.animation.figure import humanoid_figure
from roam_motion.animator import Animator
from roam_motion.models.lnsm.predict import LnsmModel
from roam_motion.training.data.library import LibraryConfig, load_library
from roam_motion.training.data.licences import LicenceError
from roam_motion.training.learning.approaches import approach_scores, held_out_goals
from roam_motion.training.learning.loop import Learner, TrainingConfig, config_json, make_learner, train
from roam_motion.training.learning.validation import rollout_scores
from roam_motion.training.learning.weights import export, start_poses

_OWN_FOLDERS = (
    "cmu_footlock",
    "cmu_more_footlock",
    "cmu_loop",
    "reactidle_footlock",
    "derived_seat",
    "derived_lie",
)


def own_data() -> Path:
    """The data root: the environment variable ROAM_DATA, else `../shared` beside the checkout."""
    return Path(os.environ.get("ROAM_DATA", Path(__file__).resolve().parents[5] / "shared")) / "mocap"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="roam train motion", description=__doc__.splitlines()[0] if __doc__ else None)
    add_data_options(parser)
    parser.add_argument("--out", type=Path, default=Path("runs/motion"), help="folder of this run")
    parser.add_argument("--minutes", type=float, default=90.0, help="training time")
    parser.add_argument("--resume", action="store_true", help="go on from the run's latest checkpoint")
    parser.add_argument("--init", type=Path, metavar="WEIGHTS", help="begin with published weights (.safetensors)")
    parser.add_argument("--threads", type=int, default=1, help="torch threads; one is best on a busy machine")
    parser.add_argument("--batch", type=int, default=TrainingConfig.batch)
    parser.add_argument("--rollouts", type=int, default=TrainingConfig.rollouts)
    parser.add_argument("--updates-per-step", type=int, default=TrainingConfig.updates_per_step)
    parser.add_argument("--rate", type=float, default=TrainingConfig.rate)
    parser.add_argument("--experts", type=int, default=TrainingConfig.experts)
    parser.add_argument("--hidden", type=int, default=TrainingConfig.hidden)
    parser.add_argument("--encoding", type=int, default=TrainingConfig.encoding)
    parser.add_argument("--horizon", type=float, default=TrainingConfig.horizon)
    parser.add_argument("--export", type=Path, help="write the best checkpoint as .safetensors here when done")
    return parser


def add_data_options(parser: argparse.ArgumentParser) -> None:
    """The options that `library_of` reads."""
    parser.add_argument("--bvh", action="append", type=Path, metavar="DIR", help="folder of BVH files (repeatable)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--goals", type=Path, metavar="DIR", help="goal poses made by roam_evaluation.motion.goals")
    parser.add_argument(
        "--share-alike", action="store_true", help="clips under CC BY-SA may be used; so are the weights then"
    )
    parser.add_argument("--cache", type=Path, default=Path("runs/cache"), help="where prepared data are kept")


def library_of(options: argparse.Namespace) -> LibraryConfig | None:
    """What data are asked for; None, with a word on it, when there are none."""
    folders = options.bvh or [own_data() / name for name in _OWN_FOLDERS]
    missing = [f for f in folders if not f.is_dir()]
    if missing:
        print(f"no such folder: {', '.join(map(str, missing))}; give --bvh DIR or set ROAM_DATA")
        return None
    goals = options.goals and str(options.goals)
    return LibraryConfig(tuple(map(str, folders)), goals, options.seed, share_alike=options.share_alike)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs a training. Returns the process exit code."""
    options = _parser().parse_args(argv)
    torch.set_num_threads(options.threads)
    figure = humanoid_figure()
    library = library_of(options)
    if library is None:
        return 2
    print("preparing the data (cached afterwards) …", flush=True)
    try:
        dataset, held_out, summary = load_library(figure, library, options.cache)
    except LicenceError as error:
        print(error)
        return 2
    print(json.dumps(summary), flush=True)
    config = _config(options)
    run: Path = options.out
    run.mkdir(parents=True, exist_ok=True)
    learner = make_learner(figure, config)
    if options.resume:
        learner.load(torch.load(run / "latest.pt", weights_only=True))
        print(f"resuming after {learner.updates} updates, {learner.seconds / 60:.1f} min", flush=True)
    else:
        if options.init:
            learner.begin_from(options.init)
        for stale in ("curve.jsonl", "validation.jsonl", "best.json"):
            (run / stale).unlink(missing_ok=True)
    (run / "config.json").write_text(
        config_json(config, {"init": _hash(options.init), "library": asdict(library), "data": summary})
    )

    poses, starts = held_out_goals(figure, held_out), start_poses(figure, dataset)

    def validate(state: Learner) -> dict[str, float]:
        predict = state.predict(averaged=True)
        scores = rollout_scores(figure, held_out, predict, torch.Generator().manual_seed(1))
        if poses and len(starts["start.height"]):
            stances = {name.removeprefix("start."): stance for name, stance in starts.items()}
            served = LnsmModel(figure, copy.deepcopy(state.averaged), state.normaliser, stances)
            scores |= approach_scores(Animator(served), poses)
            scores["score"] += scores["people"]
        print("validation", json.dumps({k: round(v, 4) for k, v in scores.items()}), flush=True)
        return scores

    train(figure, dataset, config, run, learner=learner, validate=validate, report=lambda line: print(line, flush=True))
    if options.export:
        export(run / "best.pt", options.export, figure, dataset)
    return 0


def _hash(weights: Path | None) -> str | None:
    """What a run began with, for its record."""
    return hashlib.sha256(weights.read_bytes()).hexdigest() if weights else None


def _config(options: argparse.Namespace) -> TrainingConfig:
    config = TrainingConfig(
        minutes=options.minutes,
        seed=options.seed,
        batch=options.batch,
        rollouts=options.rollouts,
        updates_per_step=options.updates_per_step,
        rate=options.rate,
        experts=options.experts,
        hidden=options.hidden,
        encoding=options.encoding,
        horizon=options.horizon,
    )
    # Published weights stay on the track already: long roll-outs from the start.
    return replace(config, warm_up=0.0, ramp=0.0) if options.init else config


if __name__ == "__main__":
    raise SystemExit(main())
