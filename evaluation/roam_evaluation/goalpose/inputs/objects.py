"""The objects that goal poses are evaluated on: any folder of canonical meshes, with or without a catalogue."""

import argparse
import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from roam_goalpose.furniture import TABLE, generate
from roam_goalpose.objects import format_of
from roam_goalpose.training.examples import is_held_out
from roam_goalpose.training.store import HELD_OUT_SEEDS

EXTENSIONS = (".glb", ".gltf", ".obj", ".ply", ".stl", ".off")
# Nothing to sit on in the usual way; asked for by name or by --categories.
LEFT_OUT = frozenset(row.name for row in TABLE.values() if not row.sitting)
# One place to sit, in the middle; on the others several places are as good.
ONE_SEAT = frozenset(row.name for row in TABLE.values() if row.one_seat)
# What is generated when real meshes are too few, in turn; twice as many chairs as the others, as among real ones.
GENERATED = ("chair", "armchair", "sofa", "chair", "stool", "officechair", "bench", "barstool")
# Generated where they are named.
TO_LIE_ON = tuple(sorted(row.name for row in TABLE.values() if row.lying and row.share))


@dataclass(frozen=True)
class EvaluationObject:
    """A mesh and what is known of it."""

    path: Path  # of the file; of generated furniture only a name
    category: str  # "unknown" without a catalogue
    subtype: str
    seat_height: float | None  # [m] above the floor
    seed: int | None = None  # of generated furniture

    @property
    def name(self) -> str:
        """File name without its ending."""
        return self.path.stem

    @property
    def format(self) -> str:
        """How `read` is to be understood."""
        return format_of(self.path.name)

    def read(self) -> bytes:
        """The file."""
        if self.seed is None:
            return self.path.read_bytes()
        file = io.BytesIO()
        generate(self.category, self.seed).to_trimesh().export(file, file_type="ply")
        return file.getvalue()


def add_object_options(parser: argparse.ArgumentParser) -> None:
    """Options that name the objects of a study."""
    parser.add_argument("--objects", type=Path, action="append", default=[], help="folder of meshes; repeat for more")
    parser.add_argument(
        "--held-out", type=Path, action="append", default=[], help="training folder: only what field training left out"
    )
    parser.add_argument(
        "--generated", type=int, default=0, help="also so many generated pieces whose seeds training never used"
    )
    parser.add_argument("--categories", help="comma-separated, default all but beds")
    parser.add_argument("--limit", type=int, default=0, help="at most so many objects, spread over the list")


def chosen_objects(options: argparse.Namespace) -> list[EvaluationObject]:
    """The objects that the options name. Raises SystemExit with advice when there are none."""
    categories = set(options.categories.split(",")) if options.categories else None
    found = find_objects(options.objects, options.held_out, categories=categories)
    found += generated_objects(options.generated, categories=categories)
    if not found:
        raise SystemExit("no objects found; give a folder of .glb, .obj, .ply, .stl or .off files")
    return spread(found, options.limit) if options.limit else found


def spread(items: list[EvaluationObject], count: int) -> list[EvaluationObject]:
    """`count` of the items, evenly spaced, so that every category has its share."""
    chosen = np.unique(np.linspace(0, len(items) - 1, min(count, len(items))).round().astype(int))
    return [items[i] for i in chosen]


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


def generated_objects(count: int, *, categories: set[str] | None) -> list[EvaluationObject]:
    """Generated pieces whose seeds field training keeps for itself to be tested with; beds and loungers if named."""
    kinds = [kind for kind in GENERATED if categories is None or kind in categories]
    kinds += [kind for kind in TO_LIE_ON if categories and kind in categories]
    found = []
    for k in range(count if kinds else 0):
        kind, seed = kinds[k % len(kinds)], HELD_OUT_SEEDS + k
        height = generate(kind, seed).seat_height
        found.append(EvaluationObject(Path(f"{kind}_generated_{seed}.ply"), kind, "generated", height, seed))
    return found


def read_catalogue(path: Path) -> dict[str, dict[str, str]]:
    """Rows by file name; empty when there is no such file."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {row["file"]: row for row in csv.DictReader(file)}
