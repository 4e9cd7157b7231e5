"""Whether motions are still those of an earlier build: approaches recorded there, played again here.

    python -m roam_evaluation.motion.regression record FILE --objects DIR [--lie-objects DIR] --poses DIR
    python -m roam_evaluation.motion.regression compare FILE [--within 1e-4]

A recording holds all that motions depend on (goal poses, obstacles, volumes, starts, seeds), to be compared with on any
machine; only weights must be the same. Every character walks up and takes its goal pose, gets up, and is steered.
"""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from roam_character.pose import Pose
from roam_character.skeleton import humanoid_skeleton
from roam_character.volume import Volume
from roam_motion.animator import Animator, FrameData
from roam_motion.app import SHIPPED_WEIGHTS
from roam_motion.control.intent import Goal, Idle, Intent, Steer

from roam_evaluation.goalpose.inputs.objects import find_objects
from roam_evaluation.motion.goals import SeatGoal, make_goals
from roam_evaluation.motion.runs import Start, draw_starts

_FRAMES = 420, 300, 60  # towards the goal, getting up, steered
_SPREAD = math.radians(100)
_SPEED = 0.8  # [m/s] steered
_SEED = 3

Recording = dict[str, np.ndarray]


def play(goals: Sequence[Goal], starts: Sequence[Start], weights: Path = SHIPPED_WEIGHTS) -> Recording:
    """All characters in one batch: what every frame shows, T frames of N characters."""
    animator = Animator.load(weights)
    states = [animator.start((s.x, s.z), s.heading, s.seed) for s in starts]
    approach, leave, steered = _FRAMES
    steer = [Steer(_SPEED * np.array([math.sin(i), math.cos(i)])) for i in range(len(goals))]
    plan: list[Sequence[Intent]] = [goals] * approach + [[Idle()] * len(goals)] * leave + [steer] * steered
    shown: list[list[FrameData]] = []
    for intents in plan:
        pairs = animator.step(states, intents)
        states = [state for state, _ in pairs]
        shown.append([frame for _, frame in pairs])
    distances = [[math.nan if f.goal_distance is None else f.goal_distance for f in row] for row in shown]
    return {
        "positions": np.stack([[frame.positions for frame in row] for row in shown]),
        "rotations": np.stack([[frame.rotations for frame in row] for row in shown]),
        "contacts": np.stack([[frame.contacts for frame in row] for row in shown]),
        "actions": np.array([[frame.action for frame in row] for row in shown]),
        "distances": np.array(distances),
    }


def written(goals: Sequence[SeatGoal], starts: Sequence[Start]) -> Recording:
    """What `read` needs to make the same goals and starts."""
    arrays: Recording = {
        "names": np.array([goal.name for goal in goals]),
        "goal_actions": np.array([goal.action for goal in goals]),
        "starts": np.array([[s.x, s.z, s.heading, s.seed] for s in starts], float),
    }
    for number, goal in enumerate(goals):
        intent, volume = goal.intent, goal.intent.volume
        assert volume is not None
        arrays[f"{number}.root_position"] = intent.pose.root_position
        arrays[f"{number}.rotations"] = intent.pose.rotations
        arrays[f"{number}.origin"], arrays[f"{number}.values"] = volume.origin, volume.values
        arrays[f"{number}.grid"] = np.array([volume.pitch, volume.yaw])
        for index, outline in enumerate(intent.obstacles):
            arrays[f"{number}.obstacle{index}"] = np.array(outline, float)
    return arrays


def read(recording: Recording) -> tuple[list[Goal], list[Start]]:
    """Goals and starts of a recording."""
    goals = []
    for number, action in enumerate(recording["goal_actions"].tolist()):
        part = {key.split(".")[1]: value for key, value in recording.items() if key.startswith(f"{number}.")}
        pitch, yaw = part["grid"].tolist()
        outlines = [part[f"obstacle{index}"] for index in range(sum(key.startswith("obstacle") for key in part))]
        goals.append(
            Goal(
                Pose(humanoid_skeleton(), part["root_position"], part["rotations"]),
                action,
                None,
                tuple(tuple(map(tuple, outline.tolist())) for outline in outlines),
                Volume(part["origin"], pitch, yaw, part["values"]),
            )
        )
    return goals, [Start(x, z, heading, int(seed)) for x, z, heading, seed in recording["starts"].tolist()]


def compare(recording: Recording, weights: Path = SHIPPED_WEIGHTS) -> dict[str, float]:
    """The largest differences to a recording: metres, quaternion components, and how many frames' labels differ."""
    now = play(*read(recording), weights)
    apart = np.linalg.norm(now["positions"] - recording["positions"], axis=-1).max((0, 2))
    for name, distance in zip(recording["names"].tolist(), apart.tolist(), strict=True):
        print(f"{name:<44} {distance:.2e} m")
    return {
        "positions_m": float(apart.max()),
        "rotations": float(np.abs(now["rotations"] - recording["rotations"]).max()),
        "distances_m": float(np.nanmax(np.abs(now["distances"] - recording["distances"]))),
        "contacts_differ": float((now["contacts"] != recording["contacts"]).any(-1).sum()),
        "actions_differ": float((now["actions"] != recording["actions"]).sum()),
    }


def record(options: argparse.Namespace) -> None:
    """Makes the goal poses that are not there yet, plays them and writes all of it down."""
    goals: list[SeatGoal] = []
    for action, folders in (("sit", options.objects), ("lie", options.lie_objects)):
        objects = find_objects(folders, held_out=(), categories=None) if folders else []
        goals += make_goals(objects[: options.limit], action=action, remembered=options.poses)
    starts = draw_starts(goals, spread=_SPREAD, seed=_SEED)
    shown = play([goal.intent for goal in goals], starts)
    np.savez_compressed(options.file, **written(goals, starts), **shown)  # type: ignore[arg-type]  # numpy's own names


def main(argv: Sequence[str] | None = None) -> int:
    """See --help; 1 when motions differ by more than --within."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("file", type=Path, help="the recording, NPZ")
    parser.add_argument("--objects", type=Path, action="append", default=[], help="folder of meshes to sit on")
    parser.add_argument("--lie-objects", type=Path, action="append", default=[], help="folder of meshes to lie on")
    parser.add_argument("--poses", type=Path, help="folder where synthesised goal poses are remembered")
    parser.add_argument("--limit", type=int, default=14, help="at most so many objects for each action")
    parser.add_argument("--within", type=float, default=1e-4, help="largest difference of a joint that is the same [m]")
    options = parser.parse_args(argv)
    torch.set_num_threads(1)
    if options.what == "record":
        record(options)
        return 0
    with np.load(options.file) as file:
        figures = compare(dict(file))
    print(figures)
    return 0 if figures["positions_m"] <= options.within and not figures["actions_differ"] else 1


if __name__ == "__main__":
    raise SystemExit(main())
