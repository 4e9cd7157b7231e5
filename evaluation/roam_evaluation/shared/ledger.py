"""Results of a study in one JSON file, written after every object: an interrupted run goes on where it stopped."""

import json
import platform
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

Record = dict[str, Any]


class Ledger:
    """Records of a study by key (usually an object's name), with the plan that they were made with.

    Records of another plan are not mixed in: the file is then begun anew. `minutes` bounds one run of the program;
    None: no bound. Without a `path` nothing is kept.
    """

    def __init__(
        self,
        path: Path | None,
        plan: Record,
        *,
        summarise: Callable[[list[Record]], Any],
        minutes: float | None = None,
    ) -> None:
        self._path = path
        self._plan = json.loads(json.dumps(plan))
        self._summarise = summarise
        self._started = time.monotonic()
        self._end = None if minutes is None else self._started + 60 * minutes
        self._before = 0.0  # minutes that earlier runs took
        self._found: dict[str, list[Record]] = {}
        self._resume()

    @property
    def records(self) -> list[Record]:
        """All records, in the order of their making."""
        return [record for records in self._found.values() for record in records]

    def pending(self, keys: Iterable[str]) -> Iterator[str]:
        """Those keys that have no records yet, as long as there is time."""
        for key in keys:
            if self._end is not None and time.monotonic() > self._end:
                return
            if key not in self._found:
                yield key

    def add(self, key: str, records: list[Record]) -> None:
        """Keeps the records of one key and writes the file."""
        self._found[key] = records
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._path.write_text(_text(self.report()))

    def report(self) -> Record:
        """What the file holds."""
        minutes = self._before + (time.monotonic() - self._started) / 60
        return {
            "plan": self._plan,
            "machine": {
                "system": platform.system(),
                "processor": platform.machine(),
                "python": platform.python_version(),
            },
            "minutes": round(minutes, 1),
            "summary": self._summarise(self.records) if self.records else {},
            "runs": self._found,
        }

    def _resume(self) -> None:
        if self._path is None or not self._path.exists():
            return
        report = json.loads(self._path.read_text())
        if report.get("plan") == self._plan and isinstance(report.get("runs"), dict):
            self._found = report["runs"]
            self._before = report["minutes"]


def _text(report: Record) -> str:
    """The report as JSON with a line for every record: readable, and small enough to be kept."""
    runs = [
        f"  {json.dumps(key)}: [\n" + ",\n".join(f"   {json.dumps(record)}" for record in records) + "\n  ]"
        for key, records in report["runs"].items()
    ]
    head = json.dumps({name: value for name, value in report.items() if name != "runs"}, indent=1)
    return head.removesuffix("\n}") + ',\n "runs": {\n' + ",\n".join(runs) + "\n }\n}\n"
