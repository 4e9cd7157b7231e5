"""Fits the rule that tells table tops from seats: python -m roam_goalpose.training.table_like [--pieces N] [--out FILE]

Benches, stools, beds and daybeds without a back behind the sitter stand against tables of the sizes that shops sell:
coffee, side, dining and desk. A person is seated on each, the seat is measured as every answer's is, and the limits of
`TableLike` are moved one after the other as long as that tells more tables from seats.
"""

import argparse
import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import trimesh

from roam_goalpose.assessment.diagnostics import TABLE_LIKE_FILE, TableLike
from roam_goalpose.furniture import generate
from roam_goalpose.objects import load_shape
from roam_goalpose.synthesis import GoalPoseRequest, Synthesizer

SEATS = ("bench", "stool", "bed", "daybed")
# Length, depth and height [m] of tops, smallest and largest.
TABLES = {
    "coffee": ((0.8, 1.3), (0.45, 0.8), (0.32, 0.50)),
    "side": ((0.4, 0.6), (0.4, 0.6), (0.40, 0.60)),
    "dining": ((1.1, 2.0), (0.7, 1.0), (0.70, 0.76)),
    "desk": ((1.0, 1.6), (0.55, 0.8), (0.70, 0.76)),
}
FIRST_SEED = 2_000_000
NO_BACK = 0.06  # [m] of air behind the back from which a seat is measured for this
MEASURES = {  # which diagnostic each limit is one of
    "broad": "seat_breadth",
    "long": "seat_length",
    "deep": "seat_breadth",
    "low": "seat_height",
    "low_depth": "seat_breadth",
}


@dataclass(frozen=True)
class Sample:
    """One top that somebody sits on."""

    name: str
    table: bool
    values: dict[str, float]  # diagnostics


def table_mesh(kind: str, seed: int) -> trimesh.Trimesh:
    """A top on four legs, standing on y = 0."""
    rng = np.random.default_rng([len(kind), seed])
    length, depth, height = (rng.uniform(*limits) for limits in TABLES[kind])
    top = trimesh.creation.box((length, 0.03, depth))
    top.apply_translation((0, height - 0.015, 0))
    legs = []
    for x in (-1, 1):
        for z in (-1, 1):
            leg = trimesh.creation.box((0.05, height - 0.03, 0.05))
            leg.apply_translation((x * (length / 2 - 0.05), (height - 0.03) / 2, z * (depth / 2 - 0.05)))
            legs.append(leg)
    found = trimesh.util.concatenate([top, *legs])
    assert isinstance(found, trimesh.Trimesh)
    return found


def meshes(count: int) -> Iterator[tuple[str, bool, trimesh.Trimesh]]:
    """`count` seats and as many tables, in turn."""
    for k in range(count):
        seat, table = SEATS[k % len(SEATS)], list(TABLES)[k % len(TABLES)]
        yield f"{seat}:{FIRST_SEED + k}", False, generate(seat, FIRST_SEED + k).to_trimesh()
        yield f"{table}:{k}", True, table_mesh(table, k)


def samples(synthesizer: Synthesizer, count: int) -> list[Sample]:
    """Those of the tops that have no back behind the sitter."""
    found = []
    for name, table, mesh in meshes(count):
        file = io.BytesIO()
        mesh.export(file, file_type="ply")
        shape = load_shape(file.getvalue(), "ply", unit="m", up="y")
        values = synthesizer.synthesize(shape, GoalPoseRequest(action="sit")).diagnostics
        if values.get("lean_miss", 1.0) > NO_BACK:
            found.append(Sample(name, table, values))
            print(f"{name:16} breadth {values['seat_breadth']:.2f} length {values['seat_length']:.2f} m", flush=True)
    return found


def score(rule: TableLike, found: Sequence[Sample]) -> float:
    """Share of tables told less share of seats taken for tables."""
    tables = [rule.holds(sample.values) for sample in found if sample.table]
    seats = [rule.holds(sample.values) for sample in found if not sample.table]
    return float(np.mean(tables)) - float(np.mean(seats))


def fitted(found: Sequence[Sample], start: TableLike) -> TableLike:
    """One limit after the other moved to where it tells most, half-way between two samples; until none moves."""
    rule, best = start, score(start, found)
    improved = True
    while improved:
        improved = False
        for name, measure in MEASURES.items():
            values = np.unique([sample.values[measure] for sample in found])
            for limit in (values[1:] + values[:-1]) / 2:
                moved = replace(rule, **{name: round(float(limit), 3)})
                if (now := score(moved, found)) > best + 1e-9:
                    rule, best, improved = moved, now, True
    return rule


def main(argv: Sequence[str] | None = None) -> int:
    """Measures, fits, writes and tells how many of each are told right."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--pieces", type=int, default=40, help="seats, and as many tables")
    parser.add_argument("--out", type=Path, default=TABLE_LIKE_FILE)
    options = parser.parse_args(argv)
    found = samples(Synthesizer.load(), options.pieces)
    before = TableLike.load()
    rule = fitted(found, before)
    print(f"tables told less seats mistaken: {score(before, found):.3f} before, {score(rule, found):.3f} now")
    options.out.write_text(json.dumps(asdict(rule), indent=1) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
