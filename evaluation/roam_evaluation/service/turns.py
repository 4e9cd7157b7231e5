"""Seconds of an earlier build beside this one's, in one run: both take turns, so the ratio holds on a busy machine.

    python -m roam_evaluation.service.turns --before DIR --json FILE

`DIR` is a checkout of the earlier build with its weights. Times are the least of all turns: what the machine allows.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from roam_serving.shipped import OBJECTS

_HERE = Path(__file__).parents[3]
_COUNTS = ("1", "64")


def _folders(root: Path) -> list[Path]:
    """Where the packages of a build lie; before they were called roam_*, services/ itself was on the path."""
    rooms = [root / "services" / name for name in ("character", "goalpose", "motion", "serving")]
    return [room for room in rooms if (room / f"roam_{room.name}").is_dir()] or [root / "services", root]


def _turn(root: Path, object_file: Path) -> dict[str, float]:
    """One turn of a build, in a process of its own with one thread."""
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(map(str, _folders(root))),
        "OMP_NUM_THREADS": "1",
        "PYTHONSAFEPATH": "1",
    }
    command = [sys.executable, str(Path(__file__).with_name("timing.py")), str(root), str(object_file), *_COUNTS]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{root} does not run:\n{done.stderr[-2000:]}")
    figures: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return figures


def compare(before: Path, after: Path, object_file: Path, *, turns: int) -> dict[str, dict[str, float]]:
    """For every figure the seconds before and after, and their ratio (below 1: faster now)."""
    found: dict[str, list[dict[str, float]]] = {"before": [], "after": []}
    for _ in range(turns):
        for name, root in (("before", before), ("after", after)):
            found[name].append(_turn(root, object_file))
    least = {name: {key: min(turn[key] for turn in all_) for key in all_[0]} for name, all_ in found.items()}
    return {
        key: {"before": seconds, "after": least["after"][key], "ratio": least["after"][key] / seconds}
        for key, seconds in least["before"].items()
    }


def _commit(root: Path) -> str:
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=root, capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or "no checkout"


def main(argv: Sequence[str] | None = None) -> int:
    """Compares two builds and keeps the figures."""
    parser = argparse.ArgumentParser(description="an earlier build beside this one")
    parser.add_argument("--before", type=Path, required=True, help="checkout of the earlier build")
    parser.add_argument("--after", type=Path, default=_HERE, help="checkout of the other one (default: this)")
    parser.add_argument("--name", default="", help="what the earlier build is called, where it is no checkout of git")
    parser.add_argument("--object", type=Path, default=OBJECTS / "chair.glb")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(argv)
    load = os.getloadavg()[0]
    figures: dict[str, Any] = compare(options.before, options.after, options.object, turns=options.turns)
    for key, row in figures.items():
        print(f"{key:14} {1e3 * row['before']:9.2f} ms → {1e3 * row['after']:9.2f} ms  × {row['ratio']:.3f}")
    if options.json:
        machine = {"platform": platform.platform(), "cores": os.cpu_count(), "load": [load, os.getloadavg()[0]]}
        builds = {"before": options.name or _commit(options.before), "after": _commit(options.after)}
        options.json.write_text(json.dumps({"builds": builds, "machine": machine, "seconds": figures}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
