"""The file formats of poses and motions, in one table: the command, the API and the documentation ask here.

A format is one module with one `FORMAT`, and one line in `_MODULES`. Another package adds its own by
`register(Format(…))`, or by an entry point of the group `roam.formats` that names a `Format`.
"""

import importlib
import importlib.metadata
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from roam_character.clip import Clip
from roam_character.formats.scene import Scene

_MODULES = ("npz", "json_file", "glb", "bvh", "vrma", "usd", "fbx", "csv_file")


class ExportError(RuntimeError):
    """A file cannot be written; the message says why, `remedy` what to do."""

    def __init__(self, message: str, *, remedy: str = "") -> None:
        super().__init__(message)
        self.remedy = remedy


def _always() -> str:
    return ""


@dataclass(frozen=True)
class Format:
    """One file format. `write` answers what the file could not hold, as sentences."""

    name: str
    title: str  # for people, one line
    extensions: tuple[str, ...]  # with the dot, lower case
    write: Callable[[Path, Scene], Sequence[str]] | None = None
    read: Callable[[Path], Clip] | None = None
    poses: bool = True  # a still pose can be written too
    furniture: bool = False  # the object is written beside the character
    missing: Callable[[], str] = field(default=_always)  # what must be installed before, "" when nothing


_added: list[Format] = []


def register(item: Format) -> Format:
    """Adds a format. Raises ValueError when a name or an ending is taken."""
    for other in formats():
        if other.name == item.name or set(other.extensions) & set(item.extensions):
            raise ValueError(f"format {item.name}: its name or one of {', '.join(item.extensions)} is {other.name}'s")
    _added.append(item)
    return item


def unregister(name: str) -> None:
    """Takes back what `register` added. KeyError when it did not."""
    found = [item for item in _added if item.name == name]
    if not found:
        raise KeyError(name)
    _added.remove(found[0])


@cache
def _shipped() -> tuple[Format, ...]:
    own = [importlib.import_module(f"roam_character.formats.{module}").FORMAT for module in _MODULES]
    others: list[Any] = [entry.load() for entry in importlib.metadata.entry_points(group="roam.formats")]
    return (*own, *others)


def formats() -> tuple[Format, ...]:
    """All formats."""
    return (*_shipped(), *_added)


def endings(*, poses: bool = False) -> tuple[str, ...]:
    """Endings that can be written, for motions or for still poses."""
    return tuple(e for f in formats() if f.write is not None and (f.poses or not poses) for e in f.extensions)


def format_of(path: str | Path) -> Format:
    """The format of a file by its ending. Raises ExportError, naming the known ones."""
    ending = Path(path).suffix.lower()
    for item in formats():
        if ending in item.extensions:
            return item
    raise ExportError(
        f"cannot write {Path(path).name}: its ending says no known format", remedy=f"Use one of {', '.join(endings())}."
    )


def write(path: str | Path, scene: Scene) -> list[str]:
    """Writes a file whole or not at all; answers what it could not hold. Raises ExportError."""
    path = Path(path)
    item = format_of(path)
    if item.write is None or (scene.is_pose and not item.poses):
        raise ExportError(f"{item.title} is not written from {'a pose' if scene.is_pose else 'a motion'}")
    if lacking := item.missing():
        raise ExportError(f"writing {path.name} needs {lacking}, which is not installed", remedy=_REMEDY)
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        notes = list(item.write(part, scene))
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    return notes


_REMEDY = "Install it, or write .glb: every format here can be made from that."


def read(path: str | Path) -> Clip:
    """A motion from a file of a format that is read. Raises ExportError for others."""
    item = format_of(path)
    if item.read is None:
        readable = [e for f in formats() if f.read is not None for e in f.extensions]
        raise ExportError(f"{Path(path).name} cannot be read as a motion", remedy=f"Read are {', '.join(readable)}.")
    return item.read(Path(path))
