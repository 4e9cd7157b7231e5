"""Steering at furniture: how deep does a body get that somebody steers through a chair?

    python -m roam_evaluation.motion.furniture --objects DIR --runs 200 --json FILE

Every run steers a character from 1 to 2.5 m away at a random place in a random object, on and on for 4 s, half of them
facing elsewhere, a third with another direction after half of the time. It knows of the object's outlines, as a session
does that had a goal on it; with `--unaware` of nothing, as a comparison.
"""

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from roam_character.body import Capsules, body_capsules
from roam_character.pose import Pose
from roam_goalpose.objects import format_of, load_shape
from roam_goalpose.objects.footprint import footprint
from roam_goalpose.objects.volume import shape_volume
from roam_motion.animation.collision import Furniture, furniture_of
from roam_motion.animator import Animator, FrameData, Steer
from roam_motion.control.paths import Outline

from roam_evaluation.goalpose.inputs.objects import EvaluationObject, find_objects
from roam_evaluation.motion.approaches import SHIPPED

_FRAMES = 120
_TURNS = 60  # frame at which some are told another direction
_BATCH = 40
_SAMPLES = 5  # along a capsule
_DEEP = 0.03  # [m]


@dataclass(frozen=True, eq=False)
class Piece:
    """An object on the floor."""

    name: str
    bounds: np.ndarray  # [2, 3] [m]
    outlines: tuple[Outline, ...]
    furniture: Furniture


def read_piece(item: EvaluationObject) -> Piece:
    """Its floor at y = 0."""
    shape = load_shape(item.path.read_bytes(), format_of(item.path.name))
    outlines = tuple(tuple(map(tuple, corners.tolist())) for corners in footprint(shape.points))
    volume = shape_volume(shape).moved(np.array([0.0, -shape.floor_height, 0.0]))
    return Piece(item.name, shape.bounds, outlines, furniture_of([volume], [np.zeros(0, np.float32)], [False]))


def draw(rng: np.random.Generator, piece: Piece) -> tuple[np.ndarray, list[Steer]]:
    """Where a character starts [2] (x, z) [m], and what it is told before and after the turn."""
    low, high = piece.bounds[0][[0, 2]], piece.bounds[1][[0, 2]]
    middle, reach = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    angle = rng.uniform(-math.pi, math.pi)
    start = middle + (reach + rng.uniform(1.0, 2.5)) * np.array([math.sin(angle), math.cos(angle)])
    way = rng.uniform(low, high) - start
    velocity = (way / np.linalg.norm(way) * rng.uniform(0.5, 1.6)).astype(np.float32)
    facing = None
    if rng.random() < 0.5:
        yaw = rng.uniform(-math.pi, math.pi)
        facing = np.array([math.sin(yaw), math.cos(yaw)], np.float32)
    first = Steer(velocity, facing)
    if rng.random() > 1 / 3:
        return start, [first, first]
    turn = rng.uniform(-1.5, 1.5)
    turned = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]) @ velocity
    return start, [first, replace(first, velocity=turned.astype(np.float32))]


def deepest(frame: FrameData, animator: Animator, capsules: Capsules, furniture: Furniture) -> float:
    """How deep the deepest capsule is in the furniture [m], 0 at least; along five samples of each."""
    pose = Pose(animator.figure.skeleton, frame.root_position, frame.rotations)
    starts, ends = (np.asarray(part) for part in capsules.segments(*pose.posture()))
    shares = np.linspace(0, 1, _SAMPLES)[:, None, None]
    points = torch.tensor((starts + shares * (ends - starts)).reshape(1, -1, 3), dtype=torch.float32)
    gaps = furniture.distance(points)[0][0].numpy()
    return max(0.0, float((np.tile(capsules.radii, _SAMPLES) - gaps).max()))


def run(animator: Animator, pieces: Sequence[Piece], seeds: Sequence[int], *, aware: bool) -> list[float]:
    """The deepest penetration of every seed's run [m]."""
    capsules = body_capsules(animator.figure.skeleton)
    states, told, furniture = [], [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        piece = pieces[int(rng.integers(len(pieces)))]
        start, steers = draw(rng, piece)
        around = piece.outlines if aware else ()
        told.append([replace(steer, around=around) for steer in steers])
        states.append(animator.start((float(start[0]), float(start[1])), float(rng.uniform(-3, 3)), seed))
        furniture.append(piece.furniture)
    worst = [0.0] * len(seeds)
    for frame in range(_FRAMES):
        pairs = animator.step(states, [steers[frame >= _TURNS] for steers in told])
        states = [state for state, _ in pairs]
        if frame % 3 == 0:
            depths = (deepest(shown, animator, capsules, of) for (_, shown), of in zip(pairs, furniture, strict=True))
            worst = list(map(max, worst, depths))
    return worst


def summarise(depths: Sequence[float]) -> dict[str, float]:
    """Figures of all runs, metres."""
    found = np.array(depths)
    return {
        "runs": len(found),
        "median_m": round(float(np.median(found)), 4),
        "p95_m": round(float(np.percentile(found, 95)), 4),
        "deepest_m": round(float(found.max()), 4),
        "deeper_than_3cm": round(float((found > _DEEP).mean()), 4),
    }


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="roam_evaluation.motion.furniture", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--objects", type=Path, required=True, help="folder of furniture files")
    parser.add_argument("--limit", type=int, default=12, help="use about so many of the objects")
    parser.add_argument("--weights", type=Path, default=SHIPPED, help="the motion network")
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--unaware", action="store_true", help="characters know of no furniture")
    parser.add_argument("--json", type=Path, help="keep the figures here")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs all seeds; 0 when it ran, whatever the figures."""
    options = parse(argv)
    animator = Animator.load(options.weights).warmed()
    items = find_objects([options.objects], [], categories=None)
    pieces = [read_piece(item) for item in items[:: max(1, len(items) // options.limit)]]
    batches = [range(k, min(k + _BATCH, options.runs)) for k in range(0, options.runs, _BATCH)]
    depths = [depth for seeds in batches for depth in run(animator, pieces, seeds, aware=not options.unaware)]
    report = {"aware": not options.unaware, "objects": [piece.name for piece in pieces], "summary": summarise(depths)}
    report["depths_m"] = [round(depth, 4) for depth in depths]
    print(json.dumps(report["summary"], indent=1))
    if options.json:
        options.json.write_text(json.dumps(report, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
