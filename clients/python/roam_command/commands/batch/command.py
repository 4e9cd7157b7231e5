"""`roam batch DIR -o OUT`: goal poses on every furniture file of a folder."""

import hashlib
import json as json_module
import os
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from roam_client.types.objects import FORMATS, TEXTS
from roam_client.types.skeleton import Skeleton

from roam_command.character import Character, CharacterChoice
from roam_command.commands.batch import engines as batch_engines
from roam_command.commands.batch.ledger import Ending, Ledger
from roam_command.commands.batch.work import Order
from roam_command.installation import services_module
from roam_command.options.groups import grouped
from roam_command.options.shared import JsonOption, Wish
from roam_command.reports import Exit, UsageError, centimetres, progress_bar, reported, stderr

# Endings of 3D files that people keep beside those that are read.
UNREAD = frozenset(
    ["3dm", "3ds", "abc", "blend", "c4d", "dae", "dwg", "dxf", "fbx", "ifc", "iges", "igs", "ma", "max", "mb", "skp"]
).union(["step", "stp", "usd", "usda", "usdc", "usdz", "wrl", "x3d"])


class Engine(StrEnum):
    """Where the work is done."""

    LOCAL = "local"
    RAY = "ray"


@grouped
def batch(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of furniture files; folders inside it count too.")
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="OUT", help="Folder for the poses; made if missing.")
    ],
    wish: Wish,
    who: CharacterChoice,
    ending: Annotated[Ending, typer.Option("--format", help="glb: body and object.")] = Ending.NPZ,
    engine: Annotated[
        Engine, typer.Option("--engine", help="local: processes of this machine; ray: a Ray cluster (RAY_ADDRESS).")
    ] = Engine.LOCAL,
    jobs: Annotated[int, typer.Option("--jobs", min=0, help="Processes at a time; 0: one per core.")] = 0,
    height: Annotated[
        float | None, typer.Option("--height", min=0.8, max=2.4, help="Height of the --character [m].")
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit code 1 when any object failed; else only when all of them did.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Make a pose for every furniture file in DIR, one line each; stop it and run it again to go on.

    OUT gets `sofa.pose.npz` for `sofa.glb`, and `batch.jsonl` with one line per object: what was made, with which
    figures, or why not. Objects done before with the same options are left alone; failures are listed and tried again
    next time.
    """
    with reported(as_json=json):
        sources = furniture_files(folder, output)
        tell_unread(folder)
        character = who.load(height=height)
        order = _order(wish, who, character)
        ledger = Ledger(output, folder, order, ending, sources, character)
        left = [source for source in sources if not ledger.has(source)]
        run = batch_engines.ray_cluster if engine is Engine.RAY else batch_engines.local
        failures: list[dict[str, Any]] = []
        skeleton = _skeleton() if character is None else character.skeleton
        with progress_bar() as bar:
            task = bar.add_task("goal poses", total=len(sources), completed=len(sources) - len(left), note="")
            for source, outcome in run(left, order, jobs=jobs or os.cpu_count() or 1):
                record = ledger.add(source, outcome, skeleton)
                bar.update(task, advance=1, note=record["file"])
                typer.echo(json_module.dumps(record, allow_nan=False) if json else line(record))
                if record["status"] == "failed":
                    failures.append(record)
        tell_summary(len(sources), len(left), failures)
        if failures and (strict or len(failures) == len(sources)):
            raise typer.Exit(Exit.FAILED)


def _order(wish: Wish, who: CharacterChoice, character: Character | None) -> Order:
    """What is wanted of every object; a character is known by its file, its map and its size."""
    plain = Order(wish.reference, wish.action.value, wish.seed, wish.unit, wish.up, wish.scale, wish.piece)
    if character is None:
        return plain
    mark = hashlib.sha256(character.path.read_bytes())
    mark.update(b"" if who.map is None else who.map.read_bytes())
    mark.update(character.skeleton.id.encode())
    body = character.skeleton.message.SerializeToString()
    name = f"sha256:{mark.hexdigest()}"
    return replace(plain, character=name, body=body)


def furniture_files(folder: Path, output: Path) -> list[Path]:
    """Every file under the folder that can be furniture, but for what a batch wrote. UsageError when there is none."""
    if not folder.is_dir():
        raise UsageError(f"there is no folder {folder}", remedy="Give a folder of furniture files.")
    found = sorted(
        path for path in folder.rglob("*") if path.suffix.lower().removeprefix(".") in set(FORMATS) - set(TEXTS)
    )
    files = [path for path in found if path.is_file() and output not in path.parents]
    if not files:
        raise UsageError(f"no furniture file in {folder}", remedy=f"What is read: {', '.join(FORMATS)}.")
    return files


def tell_unread(folder: Path) -> None:
    """Names on stderr the files that hold furniture for other programs and are left out."""
    kinds = UNREAD - set(FORMATS)
    names = sorted(path.name for path in folder.rglob("*") if path.suffix.lower().removeprefix(".") in kinds)
    if names:
        shown = ", ".join(names[:5]) + (", …" if len(names) > 5 else "")
        said = f"warning: left out {len(names)} files of kinds that are not read ({shown}): export them as .glb"
        stderr.print(said, markup=False)


def _skeleton() -> Skeleton:
    """The figure of the reference poses. UsageError when the services are not installed."""
    body_capsules = services_module("roam_character.body", wanted_by="`roam batch`").body_capsules
    humanoid_skeleton = services_module("roam_character.skeleton", wanted_by="`roam batch`").humanoid_skeleton
    skeleton_message = services_module("roam_serving.endpoints.skeletons", wanted_by="`roam batch`").skeleton_message
    figure = humanoid_skeleton()
    return Skeleton.from_message(skeleton_message(figure, body_capsules(figure)).skeleton)


def line(record: dict[str, Any]) -> str:
    """One object for people."""
    if record["status"] == "failed":
        return f"failed  {record['file']}  {record['reason']}: {record['message']}"
    hips, depth = (centimetres(record[name]) for name in ("hip_seat_distance", "penetration_depth"))
    return f"done    {record['file']}  hips to seat {hips}, penetration {depth}, {record['seconds']:.1f} s"


def tell_summary(count: int, tried: int, failures: list[dict[str, Any]]) -> None:
    """How it went, on stderr, with every failure again: they scrolled by hours ago."""
    stderr.print(f"{tried - len(failures)} done, {count - tried} done before, {len(failures)} failed", markup=False)
    for record in failures:
        stderr.print(f"  {record['file']}: {record['reason']}", markup=False)
