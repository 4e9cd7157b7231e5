"""`roam sit OBJECT`: the goal pose, then the character that walks up to it and takes it, baked."""

import time
from dataclasses import dataclass
from math import cos, radians, sin
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.progress import Progress as Bar
from roam_client import Client, Frame, GoalPose, Motion, Object, Placement, PoseWishes

from roam_command.character import Character, CharacterChoice
from roam_command.commands.pose import file_lines, goal_pose_figures, goal_pose_lines, make_goal_pose
from roam_command.exports import check_exporters, motion_endings, tell_lost, write_motion
from roam_command.options.groups import grouped
from roam_command.options.shared import (
    JsonOption,
    ObjectArgument,
    OutputOption,
    ServerChoice,
    Wish,
    checked_object,
    checked_outputs,
)
from roam_command.reports import UsageError, centimetres, print_result, progress_bar, reported, stderr, tell_warnings
from roam_command.servers import connected

DEFAULT_DISTANCE = 3.0  # [m] in front of the goal pose


@grouped
def sit(
    object: ObjectArgument,
    wish: Wish,
    who: CharacterChoice,
    to: ServerChoice,
    start: Annotated[
        str | None,
        typer.Option(
            "--start",
            metavar="X,Z,HEADING",
            help="Where the character starts, in the object's own placement: metres, and degrees about +Y where 0 "
            "faces +Z and 90 faces +X (default: 3 m in front of the goal pose, facing it).",
        ),
    ] = None,
    output: OutputOption = None,
    hold: Annotated[float, typer.Option("--hold", min=0, help="Seconds to stay in the goal pose.")] = 1.0,
    stand_up: Annotated[bool, typer.Option("--stand-up", help="Stand up again after the hold.")] = False,
    frames: Annotated[int, typer.Option("--frames", min=1, max=36000, help="Most frames to bake.")] = 900,
    height: Annotated[
        float | None,
        typer.Option("--height", min=0.8, max=2.4, help="Height of the --character [m]; default: its file's own."),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Make a character walk up to OBJECT and sit or lie on it.

    `-o` saves .glb (animated body and object), .npz, .json, .bvh, .vrma, .usdz, .fbx or .csv, all in the object file's
    own placement (metres, Y up). `--character` is your own one: its goal pose is solved for its proportions.
    """
    with reported(as_json=json):
        checked_object(object)
        outputs = checked_outputs(output, motion_endings())
        check_exporters(outputs)
        place_wanted = parse_start(start) if start is not None else None
        character = who.load(height=height)
        with connected(to) as client, progress_bar() as bar:
            began = time.perf_counter()
            place, goal, target = _goals(client, bar, object, wish, character)
            posed = time.perf_counter()
            placement = _placement(place_wanted, goal, target, character)
            with client.create_session(placement, seed=wish.seed, floor_height=goal.floor_height) as session:
                counter = _FrameCounter(bar, target)
                motion = session.bake(target, hold=hold, stand_up=stand_up, max_frames=frames, on_frame=counter.show)
            if character is not None:
                motion = character.performing(motion, goal)
            times = Times(posed - began, time.perf_counter() - posed)
        for path in outputs:
            write_motion(path, motion, source=object, object=place, character=character)
        tell_warnings([*place.warnings, *goal.warnings])
        tell_lost(outputs)
        figures = motion_figures(motion, goal, times, hold=hold)
        _tell_missed(figures, frames)
        result = {**goal_pose_figures(goal), **figures, "files": [str(path) for path in outputs]}
        lines = [*goal_pose_lines(goal), *motion_lines(figures), *file_lines(outputs)]
        if character is not None:
            character.tell()
            result["character"] = character.figures()
            lines = [*character.lines(), *lines]
        print_result(result, lines, as_json=json)


def _goals(
    client: Client, bar: Bar, source: Path, wish: Wish, character: Character | None
) -> tuple[Object, GoalPose, GoalPose]:
    """The object, the pose of whoever sits, and the pose that the animated figure goes to.

    The figure's motion is carried over to a character: it goes to a pose of its own at the character's place.
    """
    if character is None:
        place, goal = make_goal_pose(client, bar, source, wish)
        return place, goal, goal
    place, goal = make_goal_pose(client, bar, source, wish, wishes=PoseWishes(skeleton=character.skeleton))
    x, y, z = (float(value) for value in goal.root_position)
    same = PoseWishes(seat_point=(x, y, z), facing=goal.heading)
    target = client.synthesize(place, reference=wish.reference, action=wish.action.action, seed=wish.seed, wishes=same)
    return place, goal, target


def _placement(wanted: Placement | None, goal: GoalPose, target: GoalPose, character: Character | None) -> Placement:
    """Where the animated figure starts: its way is scaled about the goal, so it starts as much farther or nearer."""
    if character is None:
        return wanted or in_front_of(target, DEFAULT_DISTANCE)
    at = wanted or in_front_of(goal, DEFAULT_DISTANCE)
    ratio = character.size_ratio(target.skeleton)
    (x, _, z), (own_x, _, own_z) = (tuple(map(float, g.root_position)) for g in (target, goal))
    return Placement(x + (at.x - own_x) / ratio, z + (at.z - own_z) / ratio, at.yaw)


@dataclass(frozen=True)
class Times:
    """Seconds spent on the two halves."""

    goal_pose: float
    motion: float


class _FrameCounter:
    """Shows the way to the goal on the bar."""

    def __init__(self, bar: Bar, goal: GoalPose) -> None:
        self._bar = bar
        self._goal = goal
        self._task = bar.add_task("walking", total=1.0, note="")
        self._farthest = 1e-6  # [m]

    def show(self, frame: Frame) -> None:
        """One more frame."""
        distance = float(np.linalg.norm(frame.joint_positions - self._goal.joint_positions, axis=-1).mean())
        self._farthest = max(self._farthest, distance)
        note = f"{frame.action.name.lower()}  {distance:.2f} m to go"
        self._bar.update(self._task, completed=1 - distance / self._farthest, note=note)


def parse_start(text: str) -> Placement:
    """`X,Z,HEADING` in metres and degrees; the heading may be left out. UsageError for anything else."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not np.isfinite(numbers).all():
        raise UsageError(
            f"--start {text} is not a place",
            remedy="Write X,Z,HEADING in metres and degrees, for example --start 0,3,180.",
        )
    heading = numbers[2] if len(numbers) == 3 else 0.0
    return Placement(numbers[0], numbers[1], radians(heading))


def in_front_of(goal: GoalPose, distance: float) -> Placement:
    """A place [m] in front of the goal pose, facing it."""
    x, _, z = (float(value) for value in goal.root_position)
    yaw = goal.heading
    facing_back = (yaw + 2 * np.pi) % (2 * np.pi) - np.pi
    return Placement(x + distance * sin(yaw), z + distance * cos(yaw), float(facing_back))


def motion_figures(motion: Motion, goal: GoalPose, times: Times, *, hold: float) -> dict[str, Any]:
    """The numbers that matter, for machines; metres and seconds."""
    distances = motion.goal_distances()
    settled = motion.frame_count - 1
    if motion.goal_reached is not None:
        settled = min(settled, motion.goal_reached + round(hold * motion.frame_rate))
    hips = float(np.linalg.norm(motion.joint_positions[settled, 0] - goal.joint_positions[0]))
    x, _, z = (float(value) for value in motion.root_positions[0])
    return {
        "reached": motion.goal_reached is not None,
        "frames": motion.frame_count,
        "fps": motion.frame_rate,
        "duration": motion.duration,
        "seconds_to_goal": None if motion.goal_reached is None else (motion.goal_reached + 1) / motion.frame_rate,
        "final_position_error": float(distances[settled]),
        "final_hip_error": hips,
        "best_position_error": float(distances.min()),
        "start": [x, z],
        "seconds": {"goal_pose": times.goal_pose, "motion": times.motion, "total": times.goal_pose + times.motion},
        "realtime_factor": motion.duration / max(times.motion, 1e-9),
    }


def motion_lines(figures: dict[str, Any]) -> list[tuple[str, str]]:
    """The same for people."""
    arrival = figures["seconds_to_goal"]
    seconds = figures["seconds"]
    return [
        ("arrival", f"after {arrival:.1f} s" if arrival is not None else "not reached"),
        (
            "final error",
            f"{centimetres(figures['final_position_error'])} mean over the joints, "
            f"hips {centimetres(figures['final_hip_error'])}",
        ),
        ("motion", f"{figures['frames']} frames at {figures['fps']:g} Hz, {figures['duration']:.1f} s"),
        (
            "time",
            f"{seconds['goal_pose']:.1f} s goal pose + {seconds['motion']:.1f} s motion "
            f"({figures['realtime_factor']:.1f} x real time)",
        ),
    ]


def _tell_missed(figures: dict[str, Any], limit: int) -> None:
    if not figures["reached"]:
        stderr.print(
            f"[yellow]warning:[/] the character did not settle into the goal pose within {figures['frames']} frames "
            f"(best {figures['best_position_error'] * 100:.1f} cm). Try another --start or --seed"
            + (", or more --frames." if figures["frames"] >= limit else ".")
        )
