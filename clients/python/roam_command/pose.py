"""`roam pose OBJECT`: a goal pose on a piece of furniture."""

import time
from math import degrees
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress as Bar
from roam_client import Action, Client, GoalPose, Object, Progress

from roam_command.exports import POSE_ENDINGS, check_exporters, write_pose
from roam_command.option_groups import grouped
from roam_command.options import (
    JsonOption,
    ObjectArgument,
    OutputOption,
    ServerChoice,
    Wish,
    checked_object,
    checked_outputs,
)
from roam_command.reports import centimetres, print_result, progress_bar, reported, tell_warnings
from roam_command.servers import connected


@grouped
def pose(
    object: ObjectArgument,
    wish: Wish,
    to: ServerChoice,
    output: OutputOption = None,
    restarts: Annotated[
        int, typer.Option("--restarts", min=0, help="Initial headings tried in one batch; 0: the server's default.")
    ] = 0,
    solver: Annotated[
        str, typer.Option("--solver", metavar="default|paper", help="paper: the published schedule, slower.")
    ] = "",
    json: JsonOption = False,
) -> None:
    """Make a full-body pose that fits OBJECT, in the object file's own placement (metres, Y up).

    `-o` saves .npz, .json, or .glb (body and object).
    """
    with reported(as_json=json):
        checked_object(object)
        outputs = checked_outputs(output, POSE_ENDINGS)
        check_exporters(outputs)
        with connected(to) as client, progress_bar() as bar:
            start = time.perf_counter()
            place, goal = make_goal_pose(client, bar, object, wish, restarts=restarts, solver=solver)
            seconds = time.perf_counter() - start
        for path in outputs:
            write_pose(path, goal, source=object, object=place)
        tell_warnings([*place.warnings, *goal.warnings])
        result = {**goal_pose_figures(goal), "seconds": seconds, "files": [str(path) for path in outputs]}
        print_result(result, [*goal_pose_lines(goal), ("time", f"{seconds:.1f} s"), *file_lines(outputs)], as_json=json)


def make_goal_pose(client: Client, bar: Bar, source: Path, wish: Wish, **options: Any) -> tuple[Object, GoalPose]:
    """Uploads and optimises, with a progress bar; `options` are further ones of `Client.synthesize`."""
    task = bar.add_task("reading the object", total=None, note="")
    place = client.upload(source, unit=wish.unit, up_axis=wish.up)
    bar.update(task, description="fitting the pose")

    def show(progress: Progress) -> None:
        if progress.iteration_count:
            note = f"{progress.stage_name}  energy {progress.energy:.4f}"
            bar.update(task, total=progress.iteration_count, completed=progress.iteration, note=note)

    goal = client.synthesize(
        place, reference=wish.reference, action=wish.action.action, seed=wish.seed, on_progress=show, **options
    )
    bar.update(task, total=1, completed=1, note="")
    return place, goal


def goal_pose_figures(goal: GoalPose) -> dict[str, Any]:
    """The numbers that matter, for machines; distances in metres."""
    return {
        "goal_pose": goal.name,
        "object": goal.object,
        "reference_pose": goal.reference_pose,
        "action": Action(goal.action).name.lower(),
        "energies": goal.energies,
        "energy": goal.energies.get("total"),
        "diagnostics": goal.diagnostics,
        "hip_seat_distance": goal.diagnostics.get("hip_seat_distance"),
        "penetration_depth": goal.diagnostics.get("penetration_depth"),
        "heading_degrees": degrees(goal.heading),
        "root_position": goal.root_position.tolist(),
        "floor_height": goal.floor_height,
        "warnings": [vars(warning) for warning in goal.warnings],
    }


def goal_pose_lines(goal: GoalPose) -> list[tuple[str, str]]:
    """The same for people."""
    terms = ", ".join(f"{name} {value:.4f}" for name, value in sorted(goal.energies.items()) if name != "total")
    x, y, z = (float(value) for value in goal.root_position)
    return [
        ("pose", f"{goal.action.name.lower()}, from {goal.reference_pose.removeprefix('referencePoses/')}"),
        ("hips", f"at {x:.2f}, {y:.2f}, {z:.2f} m, heading {degrees(goal.heading):.0f}°"),
        ("hips to seat", centimetres(goal.diagnostics.get("hip_seat_distance"))),
        ("penetration", centimetres(goal.diagnostics.get("penetration_depth"))),
        ("energy", f"{goal.energies.get('total', float('nan')):.4f} ({terms})"),
    ]


def file_lines(paths: list[Path]) -> list[tuple[str, str]]:
    """Which files were written."""
    return [("saved", str(path)) for path in paths] or [("saved", "nothing; add -o FILE to keep it")]
