"""Validation on approaches: do characters lean and balance as people do when they sit down and rise?

The loss and roll-outs from recorded states do not see it: a network that leans 40 degrees inside its data may stay
upright on arrival, where characters stand still before the seat. So each checkpoint is also judged by what it does when
served: a few held-out goal poses are walked up to, taken, held and left.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from roam_character.pose import Pose
from roam_character.rotation import yaw_direction

from roam_motion.actions import SIT
from roam_motion.animation.figure import Figure
from roam_motion.animator import Animator, FrameData, Goal, Idle
from roam_motion.training.data.centre_of_mass import ahead_of_rear_ankle, lean
from roam_motion.training.data.dataset import Dataset

_CHARACTERS = 12
_FRAMES, _LEAVING = 220, 100  # to arrive and sit, and to rise
_AWAY = 1.6, 2.4  # [m] from the goal's hips
_SIDE = math.radians(40)  # off the goal's front, at most
_REACHED = 0.05  # [m] mean joint distance
_LEAN = 39.0, 35.0  # [deg] people's 5th percentile going down, and about their median minus a deviation when rising
_BALANCE = 0.02  # [m] people's 5th percentile of the centre of mass ahead of the rear ankle, half-way down
_PER_DEGREE, _PER_METRE, _PER_MISS = 0.002, 0.5, 0.3  # added to the score: 10 degrees count as 2 cm of root error


@dataclass(frozen=True, eq=False)
class Seen:
    """What one character showed: T frames."""

    positions: np.ndarray  # [T, J, 3]
    distance: np.ndarray  # [T] mean joint distance to the goal pose [m]


def held_out_goals(figure: Figure, dataset: Dataset, count: int = _CHARACTERS) -> list[Pose]:
    """Seated goal poses of a data set, evenly spaced."""
    sits = (dataset.styles[:, SIT.column] > 0.5) & (dataset.goal >= 0) & (dataset.intent == SIT.column)
    rows = torch.unique(dataset.goal[sits])
    rows = rows[torch.linspace(0, len(rows) - 1, min(count, len(rows))).long()] if len(rows) else rows
    rotations = figure.rotations(dataset.goal_orientations[rows]) if len(rows) else torch.zeros(0)
    hips = dataset.goal_positions[rows, 0]
    return [Pose(figure.skeleton, place.numpy(), turns.numpy()) for place, turns in zip(hips, rotations, strict=True)]


def approaches(animator: Animator, poses: list[Pose], seed: int = 0) -> list[Seen]:
    """Walks up to every pose, takes it, and rises when told."""
    rng = np.random.default_rng(seed)
    states = []
    for number, pose in enumerate(poses):
        angle = pose.yaw() + rng.uniform(-_SIDE, _SIDE)
        x, _, z = pose.root_position + rng.uniform(*_AWAY) * np.asarray(yaw_direction(np.asarray(angle)))
        states.append(animator.start((float(x), float(z)), angle + math.pi, number))
    goals = [Goal(pose, SIT.name) for pose in poses]
    shown: list[list[FrameData]] = []
    for frame in range(_FRAMES + _LEAVING):
        stepped = animator.step(states, goals if frame < _FRAMES else [Idle()] * len(goals))
        states = [state for state, _ in stepped]
        shown.append([data for _, data in stepped])
    tracks = np.stack([[data.positions for data in row] for row in shown], 1)
    return [
        Seen(track, np.linalg.norm(track - pose.positions(), axis=-1).mean(-1))
        for track, pose in zip(tracks, poses, strict=True)
    ]


def approach_scores(animator: Animator, poses: list[Pose]) -> dict[str, float]:
    """Medians over the approaches: lean down and up [deg], centre of mass ahead of the rear ankle half-way down and up
    [m], the share that reached; and `people`, the penalty that is added to the score."""
    if not poses:
        return {}
    seen = approaches(animator, poses)
    figure = animator.figure
    downs = [_passage(figure, s.positions[:_FRAMES]) for s in seen]
    ups = [_passage(figure, s.positions[_FRAMES - 10 :][::-1]) for s in seen]
    down, up = (np.median(np.array(rows), 0) for rows in (downs, ups))
    reached = float(np.mean([s.distance[:_FRAMES].min() < _REACHED for s in seen]))
    short = sum(max(0.0, least - got) for least, got in zip(_LEAN, (down[0], up[0]), strict=True))
    behind = sum(max(0.0, _BALANCE - got) for got in (down[1], up[1]))
    people = _PER_DEGREE * short + _PER_METRE * behind + _PER_MISS * (1 - reached)
    names = ("lean_down", "ahead_down", "lean_up", "ahead_up", "reached", "people")
    return dict(zip(names, map(float, (*down, *up, reached, people)), strict=True))


def _passage(figure: Figure, positions: np.ndarray) -> tuple[float, float]:
    """Largest lean [deg] and balance half-way [m] of the last way down in a track [T, J, 3] that ends seated."""
    heights = positions[:, 0, 1]
    low, high = float(heights[-10:].mean()), float(np.quantile(heights, 0.9))
    above = np.flatnonzero(heights > low + 0.9 * (high - low))
    begins = int(above[-1]) if len(above) else 0
    after = np.flatnonzero(heights[begins:] < low + 0.06)
    touches = begins + int(after[0]) if len(after) else len(heights) - 1
    cut = positions[max(begins - 10, 0) : touches + 1]
    ahead = figure.frame(torch.tensor(cut.copy())).direction.numpy()
    half = int(np.argmin(np.abs(cut[:, 0, 1] - (low + high) / 2)))
    skeleton = figure.skeleton
    return float(lean(skeleton, cut, ahead).max()), float(ahead_of_rear_ankle(skeleton, cut, ahead)[half])
