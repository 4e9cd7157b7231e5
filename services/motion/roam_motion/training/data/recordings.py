"""From BVH files to labelled recordings of the humanoid skeleton at 30 Hz.

A folder may carry the tables of the project's own motion-capture set (SEGMENTS.csv, CONTACTS.csv, CATALOG.csv); where
they are missing, labels are found from the motion itself (see labels.py), so any folder of BVH works.
"""

import csv
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from roam_character.clip import Clip
from roam_character.documents.bvh import read_bvh
from roam_character.retarget import RetargetError, retarget
from roam_character.skeleton import Skeleton

from roam_motion.training.data import labels

SHORTEST = 1.0  # [s] of a clip that is of use: about one gait cycle
_PLANTED = "_footlock"  # the ending of a folder whose clips are those of another one, with planted feet held still


@dataclass(frozen=True)
class Span:
    """One sitting or lying stretch, in frames: descent starts, first and last held frame, upright again."""

    action: str  # sit or lie
    down: int | None
    first: int
    last: int
    up: int | None

    def scaled(self, factor: float, count: int) -> "Span":
        """The same span at another frame rate, in a clip of `count` frames."""
        marks = (self.down, self.first, self.last, self.up)
        scale = [None if f is None else min(round(f * factor), count - 1) for f in marks]
        return Span(self.action, scale[0], scale[1] or 0, scale[2] or 0, scale[3])


@dataclass(frozen=True)
class Recording:
    """One labelled clip of the humanoid skeleton."""

    name: str
    clip: Clip
    ankle_contacts: np.ndarray | None  # [T, 2] left, right, from a table; None: found from the motion
    segments: list[str] | None  # [T] labels from a table
    spans: tuple[Span, ...]

    def at_rate(self, frame_rate: float, speed: float = 1.0) -> "Recording":
        """Resampled to a frame rate, played `speed` times as fast."""
        clip = replace(self.clip, frame_rate=self.clip.frame_rate * speed).resampled(frame_rate)
        factor = frame_rate / (self.clip.frame_rate * speed)
        pick = np.minimum(np.round(np.arange(len(clip)) / factor).astype(int), len(self.clip) - 1)
        return replace(
            self,
            clip=clip,
            ankle_contacts=None if self.ankle_contacts is None else self.ankle_contacts[pick],
            segments=None if self.segments is None else [self.segments[i] for i in pick],
            spans=tuple(span.scaled(factor, len(clip)) for span in self.spans),
        )


@dataclass(frozen=True)
class Reject:
    """A file that could not be used, and why."""

    path: Path
    reason: str


def read_folder(folder: Path, skeleton: Skeleton) -> tuple[list[Recording], list[Reject]]:
    """All recordings of a folder of BVH files, sorted by name; unreadable or non-human files are returned as
    rejects."""
    segments, contacts, spans = _segments(folder), _contacts(folder), _spans(folder)
    found: list[Recording] = []
    rejects: list[Reject] = []
    for path in sorted(folder.rglob("*.bvh")):
        try:
            clip = retarget(read_bvh(path), skeleton)
        except (RetargetError, ValueError, OSError) as error:
            rejects.append(Reject(path, str(error)))
            continue
        if clip.duration < SHORTEST:
            rejects.append(Reject(path, f"shorter than {SHORTEST:g} seconds"))
            continue
        found.append(_recording(path, clip, segments.get(path.name), contacts.get(path.name), spans))
    return found, rejects


def _recording(
    path: Path,
    clip: Clip,
    segments: list[tuple[int, int, str]] | None,
    contacts: list[tuple[int, int, int]] | None,
    spans: dict[str, tuple[Span, ...]],
) -> Recording:
    count = len(clip)
    names = None
    if segments is not None:
        names = ["idle"] * count
        for start, end, label in segments:
            names[start : end + 1] = [label] * (min(end + 1, count) - start)
    ankles = None
    if contacts is not None:
        ankles = np.zeros((count, 2), bool)
        for foot, start, end in contacts:
            ankles[start : end + 1, foot] = True
    known = spans.get(path.name)
    if known is None:
        known = tuple(Span(*span) for span in labels.find_spans(clip))
    return Recording(f"{path.parent.name}/{path.stem}", clip, ankles, names, known)


def _rows(path: Path) -> Iterator[dict[str, str]]:
    if path.exists():
        with path.open(newline="") as file:
            yield from csv.DictReader(file)


def _speaks_of(row: dict[str, str], folder: Path) -> bool:
    """Whether a table's row is about a clip of this folder, or of the one that it is the foot-locked form of."""
    return Path(row["file"]).parent.name in (folder.name, folder.name.removesuffix(_PLANTED))


def _segments(folder: Path) -> dict[str, list[tuple[int, int, str]]]:
    out: dict[str, list[tuple[int, int, str]]] = {}
    for row in [*_rows(folder / "SEGMENTS.csv"), *_rows(folder.parent / "SEGMENTS.csv")]:
        if _speaks_of(row, folder):
            out.setdefault(Path(row["file"]).name, []).append((int(row["start"]), int(row["end"]), row["label"]))
    return out


def _contacts(folder: Path) -> dict[str, list[tuple[int, int, int]]]:
    out: dict[str, list[tuple[int, int, int]]] = {}
    for row in _rows(folder / "CONTACTS.csv"):
        foot = 0 if row["foot"] == "l" else 1
        out.setdefault(row["file"], []).append((foot, int(row["start"]), int(row["end"])))
    return out


def _spans(folder: Path) -> dict[str, tuple[Span, ...]]:
    rows = list(_rows(folder / "CATALOG.csv")) or [
        row for row in _rows(folder.parent / "CATALOG.csv") if _speaks_of(row, folder)
    ]
    if rows and "part" in rows[0]:
        return _composed_spans(rows)
    out: dict[str, tuple[Span, ...]] = {}
    for row in rows:
        sits = [_span("sit", text) for text in row.get("sit_phases", "").split(";") if text]
        lies = [_span("lie", text) for text in (row.get("lie_phases") or "").split(";") if text]
        out[Path(row["file"]).name] = tuple(sits + lies)
    return out


def _span(action: str, text: str) -> Span:
    """`down>first-last>up`, the outer two possibly empty."""
    down, held, up = text.split(">")
    first, last = held.split("-")
    return Span(action, int(down) if down else None, int(first), int(last), int(up) if up else None)


def _composed_spans(rows: list[dict[str, str]]) -> dict[str, tuple[Span, ...]]:
    """Lying spans of clips whose table lists parts (sit-down, …, lie, …, stand-up)."""
    out: dict[str, tuple[Span, ...]] = {}
    for name in {row["file"] for row in rows}:
        parts = [(r["part"].split(": ")[-1], int(r["start"]), int(r["end"])) for r in rows if r["file"] == name]
        ends = {part: (start, end) for part, start, end in reversed(parts)}
        lie, down, up = ends["lie"], ends["sit-down"], ends["stand-up"]
        out[Path(name).name] = (Span("lie", down[0], lie[0], lie[1], up[1]),)
    return out
