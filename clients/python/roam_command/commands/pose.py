"""`roam pose OBJECT`: a goal pose on a piece of furniture."""

import time
from dataclasses import asdict, replace
from math import degrees
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress as Bar
from roam_client import Action, Client, GoalPose, Object, PoseWishes, Progress

from roam_command.character import Character, CharacterChoice
from roam_command.exports import check_exporters, pose_endings, tell_lost, write_pose
from roam_command.options.groups import grouped
from roam_command.options.pose import Extras
from roam_command.options.shared import (
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
    extras: Extras,
    who: CharacterChoice,
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

    `-o` saves .glb (body and object), .npz, .json, .bvh, .vrma, .usdz, .fbx or .csv; with `--count` the others get -2,
    -3, … after the name. `--character` solves the pose for your own character and writes it on its own rig.
    """
    with reported(as_json=json):
        checked_object(object)
        extras.check()
        outputs = checked_outputs(output, pose_endings())
        check_exporters(outputs)
        character = who.load(height=extras.height)
        with connected(to) as client, progress_bar() as bar:
            start = time.perf_counter()
            place, goal = make_goal_pose(
                client,
                bar,
                object,
                wish,
                reference=extras.reference(client, wish.action.action),
                restarts=restarts,
                solver=solver,
                count=extras.count,
                wishes=_for(extras.wishes(client), character),
            )
            seconds = time.perf_counter() - start
        files = write_poses(outputs, goal, source=object, object=place, character=character)
        tell_warnings([*place.warnings, *goal.warnings])
        tell_lost(files)
        others = [goal_pose_figures(other) for other in goal.alternatives]
        result = {**goal_pose_figures(goal), "alternatives": others, "seconds": seconds, "files": list(map(str, files))}
        lines = [*goal_pose_lines(goal), *alternative_lines(goal), ("time", f"{seconds:.1f} s"), *file_lines(files)]
        if character is not None:
            character.tell()
            result["character"] = character.figures()
            lines = [*character.lines(), *lines]
        print_result(result, lines, as_json=json)


def _for(wishes: PoseWishes, character: Character | None) -> PoseWishes:
    """The same wishes for the character's own proportions."""
    return wishes if character is None else replace(wishes, skeleton=character.skeleton)


def write_poses(
    outputs: list[Path], goal: GoalPose, *, source: Path, object: Object, character: Character | None = None
) -> list[Path]:
    """Writes the pose and its alternatives; the files written."""
    written = []
    for path in outputs:
        for rank, one in enumerate((goal, *goal.alternatives), start=1):
            ranked = path if rank == 1 else path.with_stem(f"{path.stem}-{rank}")
            write_pose(ranked, one, source=source, object=object, character=character)
            written.append(ranked)
    return written


def make_goal_pose(
    client: Client, bar: Bar, source: Path, wish: Wish, *, reference: str | None = None, **options: Any
) -> tuple[Object, GoalPose]:
    """Uploads and optimises, with a progress bar; `reference` wins over the wish's, `options` are further ones of
    `Client.synthesize`."""
    task = bar.add_task("reading the object", total=None, note="")
    place = client.upload(source, unit=wish.unit, up_axis=wish.up, size=wish.scale, piece=wish.piece)
    bar.update(task, description="fitting the pose")

    def show(progress: Progress) -> None:
        if progress.iteration_count:
            note = f"{progress.stage_name}  energy {progress.energy:.4f}"
            bar.update(task, total=progress.iteration_count, completed=progress.iteration, note=note)

    goal = client.synthesize(
        place,
        reference=reference or wish.reference,
        action=wish.action.action,
        seed=wish.seed,
        on_progress=show,
        **options,
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
        "quality": asdict(goal.quality),
        "place": list(goal.place),
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
        ("penetration", _penetration(goal)),
        ("energy", f"{goal.energies.get('total', float('nan')):.4f} ({terms})"),
    ]


def _penetration(goal: GoalPose) -> str:
    quality = goal.quality
    deepest = "".join(f", deepest {bone.bone}" for bone in quality.bone_penetrations[:1])
    return f"{centimetres(quality.penetration_depth)} ({1000 * quality.penetration_volume:.2f} l{deepest})"


def alternative_lines(goal: GoalPose) -> list[tuple[str, str]]:
    """One line for each of the other poses."""
    found = []
    for rank, other in enumerate(goal.alternatives, start=2):
        x, y, z = (float(value) for value in other.root_position)
        kind = other.reference_pose.removeprefix("referencePoses/")
        place = f"{kind}, hips at {x:.2f}, {y:.2f}, {z:.2f} m, heading {degrees(other.heading):.0f}°"
        found.append((f"pose {rank}", f"{place}, energy {other.energies.get('total', float('nan')):.4f}"))
    return found


def file_lines(paths: list[Path]) -> list[tuple[str, str]]:
    """Which files were written."""
    return [("saved", str(path)) for path in paths] or [("saved", "nothing; add -o FILE to keep it")]
