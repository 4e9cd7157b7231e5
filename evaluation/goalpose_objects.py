"""The objects that goal poses are evaluated on: any folder of canonical meshes, with or without a catalogue."""

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from goalpose.training.examples import is_held_out

EXTENSIONS = (".glb", ".gltf", ".obj", ".ply", ".stl", ".off")
# Nothing to sit on in the usual way; asked for by name or by --categories.
LEFT_OUT = frozenset({"bed"})
# One place to sit, in the middle; on the others several places are as good.
ONE_SEAT = frozenset({"chair", "armchair", "officechair", "barstool", "stool", "lounger"})


@dataclass(frozen=True)
class EvaluationObject:
    """A mesh and what is known of it."""

    path: Path
    category: str  # "unknown" without a catalogue
    subtype: str
    seat_height: float | None  # [m] above the floor

    @property
    def name(self) -> str:
        """File name without its ending."""
        return self.path.stem


def find_objects(
    folders: Iterable[Path], held_out: Iterable[Path], *, categories: set[str] | None
) -> list[EvaluationObject]:
    """Meshes of `folders`, and of the training folders `held_out` those that field training left out; by name."""
    found = []
    for folder, training in [*((f, False) for f in folders), *((f, True) for f in held_out)]:
        catalogue = read_catalogue(folder / "CATALOG.csv")
        for path in sorted(p for p in folder.iterdir() if p.suffix.lower() in EXTENSIONS):
            row = catalogue.get(path.name, {})
            category = row.get("category") or "unknown"
            wanted = category in categories if categories else category not in LEFT_OUT
            if not wanted or (training and not is_held_out(path.name)):
                continue
            height = row.get("seat_height_m")
            found.append(EvaluationObject(path, category, row.get("subtype", ""), float(height) if height else None))
    return found


def read_catalogue(path: Path) -> dict[str, dict[str, str]]:
    """Rows by file name; empty when there is no such file."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {row["file"]: row for row in csv.DictReader(file)}
