"""Every measure of the evaluation, from one table: measures.csv beside this file.

Columns: the group (activities that share measures), key, title, unit; how it is judged (`within`: the product's median
lies in people's 5-95 % range; `at most`: below the range is no fault, as for slides and differences of left and right;
`told`: printed only); the definition; the 5th, 50th and 95th percentile of people that the project's design notes
state, where they do; the source of a definition that is not our own.
"""

import csv
from dataclasses import dataclass
from functools import cache
from pathlib import Path

_TABLE = Path(__file__).with_name("measures.csv")


@dataclass(frozen=True)
class Measure:
    """One measure."""

    group: str
    key: str
    title: str
    unit: str
    kind: str  # within, at most, told
    definition: str
    stated: tuple[float | None, float | None, float | None]  # people's percentiles by the design notes
    source: str

    @property
    def judged(self) -> bool:
        """Has a part in the verdict."""
        return self.kind != "told"

    @property
    def one_sided(self) -> bool:
        """Less than people's range is no fault."""
        return self.kind == "at most"


@cache
def measures(group: str) -> tuple[Measure, ...]:
    """The measures of a group, in the table's order. KeyError when there is no such group."""
    found = tuple(m for m in _all() if m.group == group)
    if not found:
        raise KeyError(f"{_TABLE.name} has no measures of {group!r}")
    return found


@cache
def _all() -> tuple[Measure, ...]:
    with _TABLE.open(newline="", encoding="utf-8") as file:
        return tuple(_measure(row) for row in csv.DictReader(file))


def _measure(row: dict[str, str]) -> Measure:
    low, median, high = (float(row[f"people_{p}"]) if row[f"people_{p}"] else None for p in ("p5", "median", "p95"))
    texts = {name: row[name] for name in ("group", "key", "title", "unit", "kind", "definition", "source")}
    return Measure(**texts, stated=(low, median, high))
