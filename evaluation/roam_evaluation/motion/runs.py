"""Approaches: many characters walk up to their goals at once, and what is measured of each."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from roam_character.body import body_capsules
from roam_motion.animation.figure import Figure
from roam_motion.animator import Animator, CharacterState, FrameData, Idle

from roam_evaluation.motion.goals import SeatGoal
from roam_evaluation.motion.measures import Track

APPROACH = 300  # frames until the goal must be reached (paper, 4.2)
LEAVE = {"sit": 150, "lie": 330}  # frames to stand up in
REACHED = 0.05  # [m] mean joint distance; docs/concepts/success.md
_UPRIGHT = 0.86  # [m] hips
_RESTING = ("hips", "spine", "leftUpperLeg", "rightUpperLeg")


@dataclass(frozen=True)
class Start:
    """Where a character starts: place [m], heading [rad], seed."""

    x: float
    z: float
    heading: float
    seed: int


@dataclass(frozen=True)
class Approach:
    """One approach, judged. Metres, frames."""

    object: str
    category: str
    action: str
    mean: float  # mean joint distance to the goal pose at the best frame
    hip: float  # hip distance at that frame
    hands: float  # mean distance of both hands at that frame
    held: float  # mean joint distance at the last frame of the approach
    reached: int | None  # first frame within 5 cm
    jump: float  # largest distance that any joint moves between two frames
    jump_joint: str
    lowest: float  # lowest joint over the floor
    depth: float  # deepest body capsule in the object on the way and sitting down, until the goal is reached
    goal_depth: float  # the same of the goal pose itself
    leaving_depth: float  # the same from the command to stand on
    stood: int | None  # frames from the command until upright


@dataclass(frozen=True, eq=False)
class Take(Track):
    """The frames of one approach."""

    goal: SeatGoal
    distance: np.ndarray  # [T] to the goal pose, whether or not it is active


def draw_starts(goals: list[SeatGoal], *, spread: float, seed: int) -> list[Start]:
    """2-4 m from the goal hip, within `spread` [rad] of its front, heading within 30 degrees of facing it."""
    rng = np.random.default_rng(seed)
    starts = []
    for number, goal in enumerate(goals):
        hip = goal.pose.positions()[0]
        front = goal.pose.yaw()
        angle, distance = front + rng.uniform(-spread, spread), rng.uniform(2.0, 4.0)
        x, z = hip[0] + distance * math.sin(angle), hip[2] + distance * math.cos(angle)
        heading = angle + math.pi + rng.uniform(-math.pi / 6, math.pi / 6)
        starts.append(Start(float(x), float(z), heading, seed * 1000 + number))
    return starts


def run(animator: Animator, goals: list[SeatGoal], starts: list[Start], *, frames: int = APPROACH) -> list[Take]:
    """All approaches in one batch: `frames` towards the goal, then `LEAVE` with the command to stand."""
    states: list[CharacterState] = [animator.start((s.x, s.z), s.heading, s.seed) for s in starts]
    wishes = [g.intent for g in goals]
    shown: list[list[FrameData]] = []
    leave = max(LEAVE[goal.action] for goal in goals)
    for t in range(frames + leave):
        pairs = animator.step(states, wishes if t < frames else [Idle()] * len(goals))
        states = [state for state, _ in pairs]
        shown.append([frame for _, frame in pairs])
    takes = []
    for i, goal in enumerate(goals):
        positions = np.stack([row[i].positions for row in shown])
        contacts = np.stack([row[i].contacts for row in shown])
        distance = np.linalg.norm(positions - goal.pose.positions(), axis=-1).mean(-1)
        takes.append(Take(positions, contacts, goal, distance))
    return takes


def judge(figure: Figure, take: Take, *, frames: int = APPROACH) -> Approach:
    """The measures of one take."""
    names = figure.skeleton.joint_names
    target, way = take.goal.pose.positions(), take.positions
    distance = take.distance[:frames]
    best = int(distance.argmin())
    apart = np.linalg.norm(way[best] - target, axis=-1)
    steps = np.linalg.norm(np.diff(way, axis=0), axis=-1)
    within = np.flatnonzero(distance <= REACHED)
    upright = np.flatnonzero(way[frames:, 0, 1] > _UPRIGHT)
    seated = int(within[0]) if len(within) else frames
    return Approach(
        object=take.goal.name,
        category=take.goal.category,
        action=take.goal.action,
        mean=float(distance[best]),
        hip=float(apart[0]),
        hands=float(apart[figure.skeleton.indices(["leftHand", "rightHand"])].mean()),
        held=float(distance[-1]),
        reached=seated if len(within) else None,
        jump=float(steps.max()),
        jump_joint=names[int(steps.max(0).argmax())],
        lowest=float(way[..., 1].min()),
        depth=deepest(figure, way[:seated:3], take.goal),
        goal_depth=deepest(figure, target[None], take.goal),
        leaving_depth=deepest(figure, way[frames::3], take.goal),
        stood=int(upright[0]) if len(upright) else None,
    )


def deepest(figure: Figure, positions: np.ndarray, goal: SeatGoal) -> float:
    """Deepest point of the body's capsule axes in the object, plus radius [m], over frames [T, J, 3].

    Hips and thighs aside, which rest on the seat. Joint orientations are not needed: a capsule's axis runs along the
    bone to its child joint.
    """
    capsules = body_capsules(figure.skeleton)
    names = figure.skeleton.joint_names
    found = 0.0
    for joint, parent in enumerate(figure.skeleton.parents):
        radii = [float(r) for j, r in zip(capsules.joints, capsules.radii, strict=True) if int(j) == parent]
        if parent < 0 or names[parent] in _RESTING or not radii:
            continue
        share = np.linspace(0, 1, 4)[:, None, None]
        points = positions[None, :, parent] * (1 - share) + positions[None, :, joint] * share
        points = points + np.array([0, goal.shape.floor_height, 0])
        gap = goal.shape.distance.query(torch.tensor(points.reshape(-1, 3), dtype=torch.float32))
        found = max(found, min(radii) - float(gap.min()))
    return found
