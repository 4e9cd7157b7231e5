"""Obstacle courses: a seat somewhere in a room full of furniture. Does the character get there, and through nothing?

Every course is a seat with a goal pose, other objects' outlines strewn between it and the start, and a start up to 6 m
away in any direction and with any heading.

    python -m roam_evaluation.motion.courses --objects DIR --poses DIR --courses 100 --json FILE
"""

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import shapely
import torch
from roam_motion.animator import Animator, CharacterState
from roam_motion.control.paths import Outline
from shapely.geometry import Point, Polygon

from roam_evaluation.goalpose.inputs.objects import find_objects
from roam_evaluation.motion.approaches import SHIPPED
from roam_evaluation.motion.goals import SeatGoal, make_goals
from roam_evaluation.motion.runs import REACHED, Start, deepest

_FRAMES = 600
_OBSTACLES = 3, 7  # fewest and most beside the seat
_FREE = 1.0  # [m] round start and standing place that no obstacle enters
_BATCH = 25


@dataclass(frozen=True, eq=False)
class Course:
    """A seat, other outlines in the way, and where to start."""

    goal: SeatGoal
    obstacles: tuple[Outline, ...]  # of other objects, the floor at zero
    start: Start


@dataclass(frozen=True)
class CourseRun:
    """What became of a course. Metres, frames."""

    object: str
    obstacles: int
    distance: float  # from start to hips, straight
    reached: int | None  # first frame within 5 cm
    way: float  # of the hips until then
    inside: float  # deepest that any joint, seen from above, entered an obstacle
    depth: float  # deepest capsule in the seat's own object until it is reached


def draw_course(goal: SeatGoal, others: Sequence[SeatGoal], rng: np.random.Generator, number: int) -> Course:
    """Outlines of other objects, turned and strewn between a start and the seat."""
    hips, yaw = goal.pose.positions()[0, [0, 2]], goal.pose.yaw()
    stand = hips + 0.6 * np.array([math.sin(yaw), math.cos(yaw)])
    angle, far = rng.uniform(-math.pi, math.pi), rng.uniform(2.0, 6.0)
    start = hips + far * np.array([math.sin(angle), math.cos(angle)])
    keep = shapely.union_all([Point(start).buffer(0.5), Point(stand).buffer(_FREE)])
    keep = keep.union(shapely.union_all([Polygon(outline) for outline in goal.intent.obstacles]).buffer(0.3))
    placed: list[Outline] = []
    wanted = int(rng.integers(_OBSTACLES[0], _OBSTACLES[1] + 1))
    for _ in range(40):
        other = others[int(rng.integers(len(others)))]
        middle = start + rng.uniform(0, 1) * (hips - start) + rng.normal(size=2) * 0.9
        outline = _strewn(other.intent.obstacles[0], rng.uniform(-math.pi, math.pi), middle)
        if len(placed) < wanted and not Polygon(outline).intersects(keep):
            placed.append(outline)
    heading = float(rng.uniform(-math.pi, math.pi))
    return Course(goal, tuple(placed), Start(float(start[0]), float(start[1]), heading, number))


def _strewn(outline: Outline, yaw: float, middle: np.ndarray) -> Outline:
    corners = np.array(outline)
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    moved = (corners - corners.mean(0)) @ turn + middle
    return tuple((float(x), float(z)) for x, z in moved)


def run(animator: Animator, courses: Sequence[Course]) -> list[CourseRun]:
    """All courses in one batch."""
    states: list[CharacterState] = [
        animator.start((c.start.x, c.start.z), c.start.heading, c.start.seed) for c in courses
    ]
    intents = [replace(c.goal.intent, obstacles=c.goal.intent.obstacles + c.obstacles) for c in courses]
    shown = []
    for _ in range(_FRAMES):
        pairs = animator.step(states, intents)
        states = [state for state, _ in pairs]
        shown.append(np.stack([frame.positions for _, frame in pairs]))
    tracks = np.stack(shown, 1)  # [N, T, J, 3]
    return [judge(animator, course, track) for course, track in zip(courses, tracks, strict=True)]


def judge(animator: Animator, course: Course, track: np.ndarray) -> CourseRun:
    """Measures positions [T, J, 3]."""
    distance = np.linalg.norm(track - course.goal.pose.positions(), axis=-1).mean(-1)
    within = np.flatnonzero(distance <= REACHED)
    until = int(within[0]) if len(within) else len(track)
    hips = track[:until, 0, [0, 2]]
    target = course.goal.pose.positions()[0, [0, 2]]
    points = shapely.MultiPoint(track[:until, :, [0, 2]].reshape(-1, 2))
    areas = [Polygon(outline) for outline in course.obstacles]
    entered = [(area, shapely.get_parts(points.intersection(area))) for area in areas]
    depths = [float(shapely.distance(area.boundary, inside).max(initial=0.0)) for area, inside in entered]
    return CourseRun(
        object=course.goal.name,
        obstacles=len(course.obstacles),
        distance=float(np.linalg.norm(target - (course.start.x, course.start.z))),
        reached=until if len(within) else None,
        way=float(np.linalg.norm(np.diff(hips[::10], axis=0), axis=-1).sum()),
        inside=max(depths, default=0.0),
        depth=deepest(animator.figure, track[:until:3], course.goal),
    )


def summarise(runs: Sequence[CourseRun]) -> dict[str, float]:
    """Percent, cm, frames."""
    inside, times = np.array([r.inside for r in runs]), [r.reached for r in runs if r.reached is not None]
    return {
        "courses": len(runs),
        "obstacles_mean": round(float(np.mean([r.obstacles for r in runs])), 2),
        "reached_percent": round(100.0 * len(times) / len(runs), 1),
        "frames_to_goal_mean": round(float(np.mean(times)), 1),
        "way_over_straight_mean": round(float(np.mean([r.way / r.distance for r in runs if r.reached is not None])), 3),
        "obstacle_touched_percent": round(100.0 * float((inside > 0).mean()), 1),
        "obstacle_deeper_than_3_cm_percent": round(100.0 * float((inside > 0.03).mean()), 1),
        "inside_obstacle_worst_cm": round(100 * float(inside.max()), 2),
        "seat_depth_median_cm": round(100 * float(np.median([r.depth for r in runs])), 2),
        "seat_depth_p95_cm": round(100 * float(np.quantile([r.depth for r in runs], 0.95)), 2),
    }


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the courses."""
    parser = argparse.ArgumentParser(description="obstacle courses on the way to a seat")
    parser.add_argument("--objects", type=Path, action="append", required=True, help="folder of meshes (repeatable)")
    parser.add_argument("--poses", type=Path, help="folder where synthesised goal poses are remembered")
    parser.add_argument("--courses", type=int, default=100)
    parser.add_argument("--weights", type=Path, default=SHIPPED)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="write all figures here")
    options = parser.parse_args(argv)
    torch.set_num_threads(1)
    animator, rng = Animator.load(options.weights), np.random.default_rng(options.seed)
    goals = make_goals(
        find_objects(options.objects, held_out=(), categories=None), action="sit", remembered=options.poses
    )
    courses = [draw_course(goals[i % len(goals)], goals, rng, i) for i in range(options.courses)]
    runs = [r for i in range(0, len(courses), _BATCH) for r in run(animator, courses[i : i + _BATCH])]
    report = {"summary": summarise(runs), "runs": [asdict(r) for r in runs]}
    print(json.dumps(report["summary"], indent=1))
    if options.json:
        options.json.write_text(json.dumps(report, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
