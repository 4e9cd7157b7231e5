"""`roam evaluate motion ablation`: what every part of the motion network is worth (paper 3.2 and C).

    roam evaluate motion ablation --objects DIR --poses DIR --json FILE [--updates 1200] [--variants …] [--bvh DIR …]

Every variant is trained from scratch, on the same data with the same seed for the same number of updates, far fewer
than the shipped weights had. Then its errors are measured on held-out clips, and its approaches to goal poses on
objects nobody has seen: without the guarantee layer, which would bring all of them to the goal.
"""

import argparse
import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from roam_motion.animation.figure import Figure, humanoid_figure
from roam_motion.animator import Animator
from roam_motion.models.lnsm.config import WHOLE, Parts
from roam_motion.models.lnsm.predict import LnsmModel
from roam_motion.training.data.dataset import Dataset
from roam_motion.training.data.library import load_library
from roam_motion.training.learning.loop import Learner, TrainingConfig, make_learner, train
from roam_motion.training.learning.validation import rollout_scores, starts
from roam_motion.training.learning.weights import start_poses
from roam_motion.training.motion import add_data_options, library_of
from torch import Tensor

from roam_evaluation.goalpose.inputs.objects import find_objects
from roam_evaluation.motion.goals import SeatGoal, make_goals
from roam_evaluation.motion.runs import REACHED, draw_starts, judge, run
from roam_evaluation.shared.ledger import Ledger, Record

_BATCH = 20
_SPREAD = math.radians(60)


@dataclass(frozen=True)
class Variant:
    """What is left out, and sizes that are not the default's."""

    parts: Parts = WHOLE
    experts: int = TrainingConfig.experts
    hidden: int = TrainingConfig.hidden
    horizon: float = TrainingConfig.horizon


VARIANTS: dict[str, Variant] = {
    "default": Variant(),
    "one expert": Variant(experts=1),
    "one expert, as many weights": Variant(experts=1, hidden=952),
    "ten experts": Variant(experts=10),
    "gate without phase": Variant(Parts(gate_phase=False)),
    "gate without action": Variant(Parts(gate_action=False)),
    "no frame encoder": Variant(Parts(frame_encoder=False)),
    "no goal encoder": Variant(Parts(goal_encoder=False)),
    "no goal pose (delta = 0)": Variant(Parts(goal_pose=False)),
    "no trajectory": Variant(Parts(trajectory=False)),
    "no inverse pose": Variant(Parts(inverse=False)),
    "no contacts": Variant(Parts(contacts=False)),
    "single steps only": Variant(horizon=1.0),
}


def trained(figure: Figure, dataset: Dataset, variant: Variant, seed: int, updates: int) -> Learner:
    """A network from scratch."""
    config = TrainingConfig(
        minutes=math.inf,
        updates=updates,
        seed=seed,
        experts=variant.experts,
        hidden=variant.hidden,
        horizon=variant.horizon,
    )
    learner = make_learner(figure, config, variant.parts)
    with tempfile.TemporaryDirectory() as folder:
        train(
            figure,
            dataset,
            config,
            Path(folder),
            learner=learner,
            validate=lambda _: {"score": 0.0},
            report=lambda line: print(f"  {line}", flush=True),
            every=math.inf,
        )
    return learner


@torch.no_grad()
def step_error(figure: Figure, dataset: Dataset, learner: Learner) -> dict[str, float]:
    """One step from held-out states: mean joint error of the forward answer [mm], and of contacts [percent wrong]."""
    at = starts(dataset, torch.Generator().manual_seed(2), count=2048)
    characters, goals = dataset.characters(figure, at), dataset.goals(at)
    positions = figure.positions(characters.hips, characters.orientations)
    root = figure.frame(positions)
    answer = learner.predict(averaged=True)(characters, goals, positions, root)
    ahead = dataset.targets(figure, at)
    apart = (answer.positions - root.points_in(ahead.positions)).norm(dim=-1).mean()
    moved = (root.points_in(positions) - root.points_in(ahead.positions)).norm(dim=-1).mean()
    wrong = ((answer.contacts > 0.5) != (ahead.contacts > 0.5)).float().mean()
    return {
        "step_mm": 1000 * float(apart),
        "step_of_standing_still_mm": 1000 * float(moved),
        "contacts_wrong_percent": 100 * float(wrong),
    }


def arrivals(animator: Animator, goals: Sequence[SeatGoal], seed: int) -> dict[str, float]:
    """Approaches from 2-4 m in front, without the guarantee layer."""
    begins = draw_starts(list(goals), spread=_SPREAD, seed=seed)
    judged = []
    for i in range(0, len(goals), _BATCH):
        takes = run(animator, list(goals[i : i + _BATCH]), begins[i : i + _BATCH])
        judged += [judge(animator.figure, take) for take in takes]
    errors = np.array([[run.hip, run.hands, run.mean, run.held] for run in judged]).clip(max=10.0)
    named = zip(("hip", "hands", "mean_joint", "held"), np.median(errors, 0), strict=True)
    return {
        "reached_percent": 100 * float(np.mean([run.mean <= REACHED for run in judged])),
        **{f"{name}_median_cm": 100 * float(value) for name, value in named},
        "mean_joint_cm": 100 * float(errors[:, 2].mean()),
    }


def measure(figure: Figure, held_out: Dataset, poses: dict[str, Tensor], learner: Learner) -> dict[str, float]:
    """The errors of a learner on held-out clips."""
    predict = learner.predict(averaged=True)
    scores = rollout_scores(figure, held_out, predict, torch.Generator().manual_seed(1), learner.parts)
    rolled = {f"rollout_{name}_cm": 100 * scores[name] for name in ("root", "pose", "slide")}
    return {**step_error(figure, held_out, learner), **rolled}


def summarise(records: list[Record]) -> dict[str, Any]:
    """The figures by variant."""
    return {record["variant"]: {k: v for k, v in record.items() if k != "variant"} for record in records}


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate motion ablation", description=(__doc__ or "").split("\n")[0])
    add_data_options(parser)
    parser.add_argument("--objects", type=Path, action="append", required=True, help="folder of meshes (repeatable)")
    parser.add_argument("--poses", type=Path, help="folder where synthesised goal poses are remembered")
    parser.add_argument("--limit", type=int, default=40, help="at most so many objects")
    parser.add_argument("--updates", type=int, default=1200, help="of every variant's training")
    parser.add_argument("--variants", nargs="+", choices=tuple(VARIANTS), default=tuple(VARIANTS), metavar="VARIANT")
    parser.add_argument("--json", type=Path, help="keep all figures here; an interrupted run goes on from it")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the study; 0 when it ran, whatever the figures."""
    options = parse(argv)
    torch.set_num_threads(1)
    library = library_of(options)
    if library is None:
        return 2
    figure = humanoid_figure()
    dataset, held_out, _ = load_library(figure, library, options.cache)
    objects = find_objects(options.objects, categories=None, held_out=())
    goals = make_goals(
        objects[:: max(1, len(objects) // options.limit)][: options.limit], action="sit", remembered=options.poses
    )
    poses = {name.removeprefix("start."): pose for name, pose in start_poses(figure, dataset).items()}
    plan = {"updates": options.updates, "seed": options.seed, "goals": len(goals)}
    ledger = Ledger(options.json, plan, summarise=summarise)
    for name in ledger.pending(options.variants):
        print(name, flush=True)
        begin, variant = time.process_time(), VARIANTS[name]
        learner = trained(figure, dataset, variant, options.seed, options.updates)
        minutes = (time.process_time() - begin) / 60
        size = sum(p.numel() for p in learner.network.parameters()) / 1e6
        model = LnsmModel(figure, learner.averaged, learner.normaliser, poses)
        animator = Animator(model, variant.parts.blending(settling=False))
        figures = {**measure(figure, held_out, poses, learner), **arrivals(animator, goals, options.seed)}
        figures |= {"million_parameters": size, "cpu_minutes": minutes}
        ledger.add(name, [{"variant": name, **{k: round(v, 3) for k, v in figures.items()}}])
        print(f"  {figures}", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
