"""This build beside an earlier one: start of commands, steps, frames, goal poses, memory; both in turns, as ratios.

Absolute times drift with whatever else a machine does; a ratio of two runs one after the other hardly does. Every row
is measured in some rounds, in each of which both builds have their turn.

    python -m roam_evaluation.service.compare --against DIR [--rounds 5] [--rows pose,sit,…] [--json FILE]
"""

import argparse
import asyncio
import json
import os
import platform
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from roam_client import Client
from roam_goalpose.furniture.catalog import generate
from roam_serving.shipped import OBJECTS

from roam_evaluation.service.builds import Build, shared_memory
from roam_evaluation.service.load import load

_HERE = Path(__file__).resolve().parents[3]
_CATEGORIES = ("chair", "armchair", "sofa", "stool", "bench")

Figures = dict[str, float]  # by what is measured
Measure = Callable[[Build], Figures]


@dataclass(frozen=True)
class Options:
    """How much of everything."""

    sessions: int
    seconds: float
    pieces: int
    jobs: int


def _pose(build: Build) -> Figures:
    """`roam pose` on the bundled chair from a cold prompt."""
    with tempfile.TemporaryDirectory() as folder:
        ran = build.command("pose", str(OBJECTS / "chair.glb"), "-o", f"{folder}/pose.glb")
    return {"roam pose, wall [s]": ran.wall, "roam pose, processor [s]": ran.processor, "roam pose, MB": ran.memory}


def _sit(build: Build) -> Figures:
    """`roam sit` on the bundled chair from a cold prompt."""
    with tempfile.TemporaryDirectory() as folder:
        ran = build.command("sit", str(OBJECTS / "chair.glb"), "-o", f"{folder}/sit.glb")
    return {"roam sit, wall [s]": ran.wall, "roam sit, processor [s]": ran.processor}


def _steps(build: Build, options: Options) -> Figures:
    """One session's step, and that of many, without a server."""
    counts = (1, options.sessions)
    return {f"step of {count}, processor [ms]": 1e3 * build.step_seconds(count, 60) for count in counts}


def _frames(build: Build, options: Options) -> Figures:
    """Sessions that walk, each with a reader over gRPC."""
    with build.server("motion") as server:
        found = asyncio.run(load(server, options.sessions, options.seconds))
        memory = shared_memory(server)
    name = f"{options.sessions} sessions"
    return {
        f"{name}, server processor a frame [ms]": found["server_ms_per_frame"],
        f"{name}, frames a second of each": found["frames_per_session_second"],
        f"{name}, p99 interval error [ms]": found["interval_error_p99"],
        "motion server, MB": memory,
    }


def _answers(build: Build) -> Figures:
    """Upload to answer through a warm server, one client, every bundled object; the median."""
    with build.server("goalpose") as server, Client(goalpose=server.grpc, timeout=120) as client:
        _answered(client, OBJECTS / "stool.glb", 1)
        before = server.processor_seconds()
        taken = [_answered(client, source, 0) for source in sorted(OBJECTS.glob("*.glb"))]
        processor = (server.processor_seconds() - before) / len(taken)
        memory = shared_memory(server)
    return {
        "warm upload to answer, median [s]": float(np.median(taken)),
        "warm upload to answer, processor [s]": processor,
        "goalpose server, MB": memory,
    }


def _answered(client: Client, source: Path, seed: int) -> float:
    start = time.perf_counter()
    client.synthesize(client.upload(source), seed=seed, timeout=120)
    return time.perf_counter() - start


def _batch(build: Build, options: Options) -> Figures:
    """`roam batch` over procedural furniture, cold."""
    with tempfile.TemporaryDirectory() as folder:
        pieces = Path(folder) / "pieces"
        pieces.mkdir()
        for k in range(options.pieces):
            category = _CATEGORIES[k % len(_CATEGORIES)]
            generate(category, k).to_trimesh().export(pieces / f"{category}-{k}.glb")
        ran = build.command("batch", str(pieces), "-o", f"{folder}/poses", "--jobs", str(options.jobs))
    return {f"goal poses a minute, batch of {options.pieces}": 60 * options.pieces / ran.wall,
            f"batch of {options.pieces}, processor [s]": ran.processor}  # fmt: skip


def rows(options: Options) -> dict[str, Measure]:
    """What can be measured, by the word that asks for it."""
    return {
        "pose": _pose,
        "sit": _sit,
        "step": partial(_steps, options=options),
        "frames": partial(_frames, options=options),
        "answer": _answers,
        "batch": partial(_batch, options=options),
    }


def compared(measure: Measure, builds: tuple[Build, Build], rounds: int) -> dict[str, dict[str, Any]]:
    """Both builds in turns, the first one first in every other round: medians, the median ratio and its range."""
    found: tuple[list[Figures], list[Figures]] = ([], [])
    for turn in range(rounds):
        for which in (0, 1) if turn % 2 == 0 else (1, 0):
            found[which].append(measure(builds[which]))
    told = {}
    for name in found[0][0]:
        here, there = (np.array([figures[name] for figures in of_build]) for of_build in found)
        ratios = here / there
        told[name] = {
            "here": float(np.median(here)),
            "there": float(np.median(there)),
            "ratio": float(np.median(ratios)),
            "least": float(ratios.min()),
            "most": float(ratios.max()),
            "rounds": rounds,
        }
    return told


def _commit(root: Path) -> str:
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=root, capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or root.name


def table(figures: dict[str, dict[str, Any]]) -> str:
    """As Markdown."""
    lines = ["| what | here | there | ratio | least to most |", "|---|---|---|---|---|"]
    for name, row in figures.items():
        lines.append(
            f"| {name} | {row['here']:.3g} | {row['there']:.3g} | {row['ratio']:.2f} "
            f"| {row['least']:.2f} to {row['most']:.2f} |"
        )
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> None:
    """See --help."""
    parser = argparse.ArgumentParser(prog="roam evaluate compare", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--against", type=Path, required=True, metavar="DIR", help="checkout of the other build")
    parser.add_argument("--rounds", type=int, default=5, help="turns of both builds, of every row")
    parser.add_argument("--rows", default="pose,sit,step,frames,answer,batch", help="which, with commas between")
    parser.add_argument("--sessions", type=int, default=64, help="of steps and frames")
    parser.add_argument("--seconds", type=float, default=10.0, help="that frames are read for")
    parser.add_argument("--pieces", type=int, default=40, help="of a batch")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes of a batch")
    parser.add_argument("--json", type=Path, help="write all figures here")
    chosen = parser.parse_args(argv)
    measures = rows(Options(chosen.sessions, chosen.seconds, chosen.pieces, chosen.jobs))
    builds = Build(_HERE), Build(chosen.against.absolute())
    figures: dict[str, dict[str, Any]] = {}
    loads = [psutil.getloadavg()[0]]
    for name in chosen.rows.split(","):
        figures |= compared(measures[name], builds, chosen.rounds)
        loads.append(psutil.getloadavg()[0])
    print(table(figures))
    if chosen.json:
        record = {
            "machine": f"{platform.machine()}, {psutil.cpu_count()} processors, {platform.system()}",
            "load_averages": loads,
            "here": _commit(_HERE),
            "there": _commit(builds[1].root),
            "rows": figures,
        }
        chosen.json.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
