"""`roam evaluate uploads DIR`: files with a known size and turning, uploaded with nothing said.

    roam evaluate uploads DIR [--json FILE] [--limit N]

DIR holds `uploads.csv` with the columns `file`, `height_m` (of the real object, standing) and `up` (the file's axis
that points up: y, z, -x, …; empty when any is right). `sweet_home` makes such a folder of a furniture library.

Every file is right (the axis within 10°, the height within a third), doubted (wrong or right, but a warning says that
the size, the axis or the piece is unsure), refused, or silently wrong.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from roam_goalpose.objects import ObjectError, Shape, format_of, load_shape

TABLE = "uploads.csv"
DOUBTS = {"OBJECT_UNIT_UNSURE", "OBJECT_UP_UNSURE", "OBJECT_TILTED", "OBJECT_PIECE_CHOSEN", "OBJECT_SEAT_UNSURE"}
_AXIS = math.cos(math.radians(10))
_SIZE = math.log(4 / 3)  # half the way, in e-folds, between no two units that are confused
_AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}


@dataclass(frozen=True)
class Reading:
    """How one file was understood.

    Attributes:
        outcome: `right`, `right, doubted`, `wrong, doubted`, `refused` or `silently wrong`.
        size: height as read over the real height; None when refused.
        reasons: of the warnings, or of the refusal.
    """

    file: str
    format: str
    outcome: str
    size: float | None
    up_right: bool | None
    reasons: tuple[str, ...]
    message: str = ""


def read_upload(path: Path, row: Mapping[str, str]) -> Reading:
    """One file, as a sender who says nothing would send it."""
    try:
        format = format_of(path)
        shape = load_shape(path.read_bytes(), format)
    except ObjectError as error:
        return Reading(row["file"], path.suffix.lstrip("."), "refused", None, None, (error.reason,), error.message)
    return judge(shape, row, format)


def judge(shape: Shape, row: Mapping[str, str], format: str) -> Reading:
    """A shape against what is known of the real object."""
    size = float(np.ptp(shape.bounds[:, 1])) / float(row["height_m"])
    turn = shape.object_to_world[:3, :3]
    up = np.linalg.solve(turn, np.array([0.0, 1.0, 0.0]))
    axis = row.get("up", "")
    up_right = not axis or float(up @ np.array(_AXES[axis])) / float(np.linalg.norm(up)) > _AXIS
    right = up_right and abs(math.log(max(size, 1e-9))) < _SIZE
    reasons = tuple(warning.reason for warning in shape.warnings)
    doubted = bool(DOUBTS & set(reasons))
    outcome = (
        ("right, doubted" if doubted else "right") if right else ("wrong, doubted" if doubted else "silently wrong")
    )
    return Reading(row["file"], format, outcome, size, up_right, reasons)


def summarise(readings: Iterable[Reading]) -> dict[str, dict[str, float]]:
    """Shares by format and over all."""
    groups: dict[str, list[Reading]] = defaultdict(list)
    for reading in readings:
        groups[reading.format].append(reading)
        groups["all"].append(reading)
    found = {}
    for name, group in sorted(groups.items()):
        counts = Counter(reading.outcome for reading in group)
        share = {outcome: counts[outcome] / len(group) for outcome in OUTCOMES}
        found[name] = {
            "files": float(len(group)),
            **share,
            "right or doubted": 1 - share["silently wrong"] - share["refused"],
        }
    return found


OUTCOMES = ("right", "right, doubted", "wrong, doubted", "refused", "silently wrong")


def read_table(folder: Path) -> list[dict[str, str]]:
    """The rows of a folder's table."""
    with (folder / TABLE).open(newline="") as file:
        return list(csv.DictReader(file))


def main(argv: Sequence[str] | None = None) -> int:
    """Reads the folder; 0 when it ran, whatever the figures."""
    parser = argparse.ArgumentParser(prog="roam evaluate uploads", description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--limit", type=int)
    options = parser.parse_args(argv)
    readings = []
    for row in read_table(options.folder)[: options.limit]:
        reading = read_upload(options.folder / row["file"], row)
        readings.append(reading)
        if reading.outcome != "right":
            size = (
                ""
                if reading.size is None
                else f"size x{reading.size:.2f}, up {'right' if reading.up_right else 'wrong'}"
            )
            print(
                f"{reading.outcome:15} {reading.file[:60]:60} {size} {reading.message or reading.reasons}",
                file=sys.stderr,
            )
    summary = summarise(readings)
    for name, shares in summary.items():
        print(f"{name:5} {int(shares['files']):4} " + "  ".join(f"{o} {100 * shares[o]:5.1f} %" for o in OUTCOMES))
    if options.json:
        document = {"summary": summary, "readings": [asdict(reading) for reading in readings]}
        options.json.write_text(json.dumps(document, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
