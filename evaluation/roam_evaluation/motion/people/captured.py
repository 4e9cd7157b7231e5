"""Captured people: clips of a motion-capture folder on the humanoid skeleton at 30 Hz, held-out ones and the others."""

import csv
import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from roam_character import retarget as retargeting
from roam_character.documents.bvh import read_bvh
from roam_character.retarget import RetargetError, retarget

from roam_evaluation.motion.people.frames import RATE, SKELETON, Motion, Stretch
from roam_evaluation.motion.people.storage import read_motions, write_motions

# Folders of clips as captured. Composed, adapted and looped ones (derived_…, …_loop) are no measure of people.
FOLDERS = ("cmu_footlock", "cmu_more_footlock", "hdm05_footlock", "reactidle_footlock")


_VERSION = 1  # of what is remembered
_SOURCES = b"".join(Path(str(file)).read_bytes() for file in (retargeting.__file__, __file__))


@dataclass(frozen=True)
class Captured:
    """Clips of people."""

    held_out: list[Motion]
    training: list[Motion]

    @property
    def all(self) -> list[Motion]:
        """Both."""
        return [*self.held_out, *self.training]


def held_out_prefixes(root: Path) -> tuple[str, ...]:
    """Prefixes of file names that no training may use, from HELDOUT.txt."""
    if not (root / "HELDOUT.txt").exists():
        raise FileNotFoundError(f"{root} holds no HELDOUT.txt; give the motion-capture folder with --mocap")
    lines = (root / "HELDOUT.txt").read_text().splitlines()
    return tuple(line.strip() for line in lines if line.strip() and not line.startswith("#"))


def read_captured(root: Path, *, only_held_out: bool = False, folders: tuple[str, ...] = FOLDERS) -> Captured:
    """The clips under `root`/`folders`. FileNotFoundError with advice when HELDOUT.txt is missing."""
    prefixes = held_out_prefixes(root)
    out = Captured([], [])
    for folder in (root / name for name in folders):
        tables = _tables(folder)
        for path in sorted(folder.glob("*.bvh")):
            held = path.stem.startswith(prefixes)
            if held or not only_held_out:
                motion = _read(path, tables.get(path.name, []))
                if motion is not None:
                    (out.held_out if held else out.training).append(motion)
    return out


def fingerprint(root: Path) -> str:
    """Changes with the clips, their tables, who is held out, and the retargeting."""
    key = hashlib.sha256(_SOURCES)
    key.update(json.dumps([_VERSION, SKELETON.id, *held_out_prefixes(root)]).encode())
    for folder in (root / name for name in FOLDERS):
        for path in sorted([*folder.glob("*.bvh"), *folder.glob("*.csv"), *root.glob("*.csv")]):
            key.update(f"{path} {path.stat().st_size} {path.stat().st_mtime_ns}".encode())
    return key.hexdigest()[:12]


def cached_captured(root: Path, cache: Path) -> Captured:
    """`read_captured`, remembered in a folder until its fingerprint changes."""
    files = [cache / f"captured-{fingerprint(root)}-{part}.npz" for part in ("held-out", "training")]
    if not all(path.exists() for path in files):
        found = read_captured(root)
        for path, motions in zip(files, (found.held_out, found.training), strict=True):
            write_motions(path, motions)
    return Captured(*(read_motions(path) for path in files))


def _read(path: Path, rows: list[tuple[int, int, str]]) -> Motion | None:
    try:
        clip = retarget(read_bvh(path), SKELETON)
    except (RetargetError, ValueError) as error:
        print(f"{path.name}: {error}")
        return None
    factor = RATE / clip.frame_rate
    resampled = clip.resampled(RATE)
    last = len(resampled) - 1
    stretches = tuple(
        Stretch(label, min(round(a * factor), last), min(round(b * factor), last)) for a, b, label in rows
    )
    person = path.stem.split("_")[0] if path.parent.name != "reactidle_footlock" else path.stem.split("_")[1]
    return Motion(f"{path.parent.name}/{path.stem}", person, resampled.positions(), stretches)


def _tables(folder: Path) -> dict[str, list[tuple[int, int, str]]]:
    """Labelled stretches of a folder's files (first, last, label), and its sits and lies as `sit` and `lie` held."""
    out: dict[str, list[tuple[int, int, str]]] = {}
    plain = folder.name.removesuffix("_footlock")
    for table in (folder / "SEGMENTS.csv", folder.parent / "SEGMENTS.csv"):
        for row in _rows(table):
            if Path(row["file"]).parent.name in (plain, folder.name):
                out.setdefault(Path(row["file"]).name, []).append((int(row["start"]), int(row["end"]), row["label"]))
    for table in (folder / "CATALOG.csv", folder.parent / "CATALOG.csv"):
        for row in _rows(table):
            if Path(row["file"]).parent.name in (plain, folder.name, "."):
                for label in ("sit", "lie"):
                    held = _held(row.get(f"{label}_phases") or "")
                    out.setdefault(Path(row["file"]).name, []).extend((a, b, f"{label} held") for a, b in held)
    return out


def _held(text: str) -> list[tuple[int, int]]:
    """First and last held frames of `down>first-last>up;…`."""
    spans = [part.split(">")[1].split("-") for part in text.split(";") if part]
    return [(int(first), int(last)) for first, last in spans]


def _rows(path: Path) -> Iterator[dict[str, str]]:
    if path.exists():
        with path.open(newline="") as file:
            yield from csv.DictReader(file)
