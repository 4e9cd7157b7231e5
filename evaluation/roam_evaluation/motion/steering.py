"""Random steering: does a character that is told something else every few seconds stay whole?

Velocities forward, sideways and backward, facings, stops, goals that appear and vanish again: many characters in one
batch.

    python -m roam_evaluation.motion.steering --sessions 1000 --seconds 60 --poses DIR --json FILE
"""

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from roam_character.pose import Pose
from roam_character.skeleton import humanoid_skeleton
from roam_motion.animation.state import FRAME_RATE
from roam_motion.animator import Animator, CharacterState, Goal, Idle, Intent, Steer
from roam_motion.training.data.goals import read_given

from roam_evaluation.motion.approaches import SHIPPED

_BATCH = 64
_FASTEST = {"forward": 1.3, "along": 1.3, "sideways": 0.8, "backward": 0.8}  # [m/s]
_TURNED = {"sideways": math.pi / 2, "backward": math.pi}  # velocity from facing [rad]
_LOW, _HIGH = 0.25, 1.15  # [m] hips of a figure that neither lies on the floor nor flies
_SETTLING = 40  # frames until a wish should be followed
_JUMP = 0.20  # [m] no joint moves so far in a frame


@dataclass(frozen=True, eq=False)
class Wish:
    """What one character is told for a while."""

    kind: str
    intent: Intent
    frames: int


@dataclass(frozen=True)
class Outcome:
    """How a wish was followed."""

    kind: str
    velocity_error: float  # [m/s] mean velocity once it should be followed, from the wanted one
    facing_error: float  # [rad] mean, where a facing was wanted
    stop_way: float  # [m] walked on after a stop
    drift: float  # [m] moved in the rest of the stop


def draw_wish(rng: np.random.Generator, place: np.ndarray, poses: Sequence[Pose]) -> Wish:
    """A random wish for a character whose hips are over `place` [2] (x, z)."""
    kind = str(rng.choice([*_FASTEST, "stop", "goal" if poses else "along"]))
    frames, yaw = int(rng.integers(60, 180)), float(rng.uniform(-math.pi, math.pi))
    if kind == "stop":
        return Wish(kind, Idle(), frames)
    if kind == "goal":
        x, z = place + rng.uniform(-2.5, 2.5, 2)
        pose = poses[int(rng.integers(len(poses)))].turned(yaw).moved(np.array([x, 0, z]))
        return Wish(kind, Goal(pose), 2 * frames)
    heading = yaw + _TURNED.get(kind, 0.0) * float(rng.choice([-1, 1]))
    velocity = rng.uniform(0.25, _FASTEST[kind]) * np.array([math.sin(heading), math.cos(heading)])
    return Wish(kind, Steer(velocity, None if kind == "along" else np.array([math.sin(yaw), math.cos(yaw)])), frames)


def judge_wish(wish: Wish, roots: np.ndarray, facings: np.ndarray) -> Outcome | None:
    """How hips [T, 2] and facings [T, 2] followed a wish; None for goals, which other evaluations judge."""
    if wish.kind == "goal" or len(roots) <= _SETTLING + 10:
        return None
    seconds = (len(roots) - 1 - _SETTLING) / FRAME_RATE
    velocity = (roots[-1] - roots[_SETTLING]) / seconds
    if not isinstance(wish.intent, Steer):
        way = float(np.linalg.norm(roots[_SETTLING] - roots[0]))
        return Outcome(wish.kind, 0.0, 0.0, way, float(np.linalg.norm(roots[-1] - roots[_SETTLING])))
    error = float(np.linalg.norm(velocity - wish.intent.velocity))
    if wish.intent.facing is None:
        return Outcome(wish.kind, error, 0.0, 0.0, 0.0)
    cosine = facings[_SETTLING:] @ wish.intent.facing
    return Outcome(wish.kind, error, float(np.arccos(cosine.clip(-1, 1)).mean()), 0.0, 0.0)


@dataclass(frozen=True)
class Whole:
    """Whether a batch of sessions stayed whole."""

    sessions: int
    broken: int  # with a joint that is nowhere, under the floor or torn away, or hips on the floor or in the air
    largest_jump: float  # [m]
    lowest_joint: float  # [m]
    lowest_hips: float  # [m]
    highest_hips: float  # [m]


class Told:
    """One character and what it is told."""

    def __init__(self, animator: Animator, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.state: CharacterState = animator.start((0.0, 0.0), float(self.rng.uniform(-3, 3)), seed)
        self.wish = Wish("stop", Idle(), 30)
        self.begun = 0
        self.rises = True  # the first frames of a wish may go into getting up: not judged

    def next_wish(self, t: int, place: np.ndarray, poses: Sequence[Pose]) -> None:
        """Another wish from frame `t`."""
        self.rises = self.wish.kind == "goal"
        self.wish, self.begun = draw_wish(self.rng, place, poses), t


def run_batch(
    animator: Animator, count: int, frames: int, poses: Sequence[Pose], seed: int
) -> tuple[Whole, list[Outcome]]:
    """`count` sessions of `frames` frames side by side."""
    told = [Told(animator, seed + number) for number in range(count)]
    positions = np.empty((frames, count, animator.figure.joint_count, 3), np.float32)
    outcomes: list[Outcome | None] = []
    for t in range(frames):
        for i, one in enumerate(told):
            if t - one.begun == one.wish.frames:
                if not one.rises:
                    outcomes.append(judge_wish(one.wish, *_followed(animator, positions[one.begun : t, i])))
                one.next_wish(t, positions[t - 1, i, 0, [0, 2]], poses)
        pairs = animator.step([one.state for one in told], [one.wish.intent for one in told])
        for i, (one, (state, frame)) in enumerate(zip(told, pairs, strict=True)):
            one.state, positions[t, i] = state, frame.positions
    return whole(positions), [outcome for outcome in outcomes if outcome is not None]


def _followed(animator: Animator, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Hips [T, 2] and facings [T, 2] on the floor."""
    return positions[:, 0, [0, 2]], animator.figure.facing(torch.from_numpy(positions)).numpy()


def whole(positions: np.ndarray) -> Whole:
    """Judges sessions of positions [T, N, J, 3]."""
    jumps = np.linalg.norm(np.diff(positions, axis=0), axis=-1).max((0, 2))  # [N]
    hips, lowest = positions[:, :, 0, 1], positions[..., 1].min((0, 2))
    fine = np.isfinite(positions).all((0, 2, 3)) & (jumps < _JUMP) & (lowest > -0.01)
    fine &= (hips.min(0) > _LOW) & (hips.max(0) < _HIGH)
    return Whole(
        sessions=positions.shape[1],
        broken=int((~fine).sum()),
        largest_jump=float(jumps.max()),
        lowest_joint=float(lowest.min()),
        lowest_hips=float(hips.min()),
        highest_hips=float(hips.max()),
    )


def summarise(parts: Sequence[Whole], outcomes: Sequence[Outcome]) -> dict[str, object]:
    """Figures of all batches: m/s, degrees, cm."""

    def spread(values: list[float], scale: float) -> dict[str, float]:
        return {name: round(scale * float(np.quantile(values, q)), 2) for name, q in (("median", 0.5), ("p95", 0.95))}

    kinds: dict[str, object] = {}
    for kind in _FASTEST:
        mine = [o for o in outcomes if o.kind == kind]
        kinds[kind] = {
            "wishes": len(mine),
            "velocity_error_m_s": spread([o.velocity_error for o in mine], 1.0),
            "facing_error_degrees": spread([math.degrees(o.facing_error) for o in mine], 1.0),
        }
    stops = [o for o in outcomes if o.kind == "stop"]
    kinds["stop"] = {
        "wishes": len(stops),
        "way_after_cm": spread([o.stop_way for o in stops], 100.0),
        "drift_cm": spread([o.drift for o in stops], 100.0),
    }
    return {
        "sessions": sum(p.sessions for p in parts),
        "broken": sum(p.broken for p in parts),
        "largest_jump_cm": round(100 * max(p.largest_jump for p in parts), 2),
        "lowest_joint_cm": round(100 * min(p.lowest_joint for p in parts), 2),
        "hips_height_cm": [
            round(100 * min(p.lowest_hips for p in parts), 1),
            round(100 * max(p.highest_hips for p in parts), 1),
        ],
        "wishes": kinds,
    }


def read_poses(folder: Path) -> list[Pose]:
    """Seated goal poses over the origin, facing +Z, from a folder that evaluation.motion_goals filled."""
    skeleton = humanoid_skeleton()
    return [Pose(skeleton, key.hips, key.rotations) for key in read_given(skeleton, folder, "sit")]


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the sessions; 1 when a pose broke."""
    parser = argparse.ArgumentParser(description="random steering sessions")
    parser.add_argument("--sessions", type=int, default=64)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--poses", type=Path, help="folder of goal poses, as evaluation.motion_goals makes them")
    parser.add_argument("--weights", type=Path, default=SHIPPED)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="write the figures here, after every batch")
    options = parser.parse_args(argv)
    torch.set_num_threads(1)
    animator = Animator.load(options.weights)
    poses = read_poses(options.poses) if options.poses else []
    parts: list[Whole] = []
    outcomes: list[Outcome] = []
    for begin in range(0, options.sessions, _BATCH):
        count = min(_BATCH, options.sessions - begin)
        part, followed = run_batch(animator, count, int(options.seconds * FRAME_RATE), poses, options.seed + begin)
        parts.append(part)
        outcomes += followed
        report = {"seconds": options.seconds, **summarise(parts, outcomes)}
        if options.json:
            options.json.write_text(json.dumps(report, indent=1) + "\n")
        print(f"{report['sessions']} sessions, {report['broken']} broken", flush=True)
    print(json.dumps(report, indent=1))
    return 1 if report["broken"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
