"""Training examples on disk: made once, memory-mapped afterwards.

runs/field-data/<name>/items.json     name, category, seat height of every example
                       surface.npy    [E, 6000, 3] float16
                       normals.npy    [E, 6000, 3] int8, outward, zero where a body has no outside
                       queries.npy    [E, 12000, 3] float16
                       distance.npy   [E, 12000] float16
"""

from __future__ import annotations

import csv
import json
import math
import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import structlog
from numpy.typing import NDArray

from roam_goalpose.furniture import CATEGORIES, TABLE, generate
from roam_goalpose.training.examples import QUERY_POINTS, SURFACE_POINTS, Example, from_furniture, from_mesh

log = structlog.get_logger()

LAYOUT: dict[str, tuple[type[np.generic], tuple[int, ...]]] = {
    "surface": (np.float16, (SURFACE_POINTS, 3)),
    "normals": (np.int8, (SURFACE_POINTS, 3)),
    "queries": (np.float16, (QUERY_POINTS, 3)),
    "distance": (np.float16, (QUERY_POINTS,)),
}
"""Arrays of a store: type and shape of one example's part, in the order of `Store`'s fields."""
HELD_OUT_SEEDS = 1_000_000
"""Seeds from here on are never trained on."""


@dataclass(frozen=True, eq=False)
class Store:
    """Examples of one folder, memory-mapped."""

    names: tuple[str, ...]
    categories: tuple[str, ...]
    seat_heights: NDArray[np.float64]
    surface: NDArray[np.float16]
    normals: NDArray[np.int8]
    queries: NDArray[np.float16]
    distance: NDArray[np.float16]

    def __len__(self) -> int:
        return len(self.names)

    def only(self, categories: Sequence[str]) -> Store:
        """The examples of some categories, in memory."""
        rows = [row for row, category in enumerate(self.categories) if category in categories]
        names, kept = (tuple(text[row] for row in rows) for text in (self.names, self.categories))
        arrays = [np.asarray(getattr(self, part)[rows]) for part in LAYOUT]
        return Store(names, kept, self.seat_heights[rows], *arrays)

    @staticmethod
    def open(folder: Path) -> Store:
        """Raises FileNotFoundError if the folder was not finished by `write`."""
        items: list[dict[str, Any]] = json.loads((folder / "items.json").read_text())
        arrays = [np.load(folder / f"{part}.npy", mmap_mode="r")[: len(items)] for part in LAYOUT]
        heights = np.array([math.nan if i["seat_height"] is None else i["seat_height"] for i in items])
        names, categories = tuple(i["name"] for i in items), tuple(i["category"] for i in items)
        return Store(names, categories, heights, *arrays)


def write(folder: Path, count: int, examples: Iterable[Example]) -> None:
    """Writes up to `count` examples; `items.json` comes last, so an interrupted build is not taken for a whole one."""
    folder.mkdir(parents=True, exist_ok=True)
    arrays = {
        part: np.lib.format.open_memmap(folder / f"{part}.npy", mode="w+", dtype=dtype, shape=(count, *shape))
        for part, (dtype, shape) in LAYOUT.items()
    }
    items: list[dict[str, Any]] = []
    for row, example in enumerate(examples):
        for part, array in arrays.items():
            array[row] = getattr(example, part)
        height = None if math.isnan(example.seat_height) else example.seat_height
        items.append({"name": example.name, "category": example.category, "seat_height": height})
        if (row + 1) % 100 == 0:
            log.info("examples", folder=folder.name, done=row + 1, of=count)
    (folder / "items.json").write_text(json.dumps(items, indent=0))


def open_or_write(folder: Path, count: int, examples: Callable[[], Iterable[Example]]) -> Store:
    """The store in `folder`, made first if it is not there, beside it: another process may be making it too."""
    if not (folder / "items.json").exists():
        part = folder.with_name(f"{folder.name}.{os.getpid()}")
        write(part, count, examples())
        shutil.rmtree(folder, ignore_errors=True)
        part.replace(folder)
    return Store.open(folder)


def procedural_examples(count: int, *, seed: int, categories: Sequence[str] = CATEGORIES) -> Iterable[Example]:
    """`count` generated examples with seeds `seed`, `seed + 1`, …, mixed over `categories` by their shares."""
    weights = np.array([TABLE[category].share for category in categories], dtype=float)
    chosen = np.random.default_rng([3, seed]).choice(len(categories), count, p=weights / weights.sum())
    for k in range(count):
        category = categories[chosen[k]]
        yield from_furniture(generate(category, seed + k), name=f"{category}:{seed + k}", seed=seed + k)


def kind_examples(kind: str, count: int) -> Iterable[Example]:
    """`count` generated examples of one kind, with seeds from 0."""
    for seed in range(count):
        yield from_furniture(generate(kind, seed), name=f"{kind}:{seed}", seed=seed)


def mesh_examples(files: Sequence[Path]) -> Iterable[Example]:
    """Examples of mesh files; category and seat height come from a `CATALOG.csv` beside them, else from the name."""
    catalogs: dict[Path, dict[str, dict[str, str]]] = {}
    for path in files:
        catalog = catalogs.setdefault(path.parent, _read_catalog(path.parent))
        row = catalog.get(path.name, {})
        category = row.get("category") or path.name.split("_")[0]
        height = float(row["seat_height_m"]) if row.get("seat_height_m") else math.nan
        try:
            yield from_mesh(path, category=category, seat_height=height)
        except (ValueError, IndexError, KeyError) as error:
            log.warning("mesh rejected", file=path.name, error=str(error))


def _read_catalog(folder: Path) -> dict[str, dict[str, str]]:
    path = folder / "CATALOG.csv"
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {row["file"]: row for row in csv.DictReader(file)}
