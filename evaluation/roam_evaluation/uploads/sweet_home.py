"""A folder for `roam evaluate uploads` out of Sweet Home 3D's furniture libraries: real OBJ files of known real size.

    python -m roam_evaluation.uploads.sweet_home OUT LIBRARY.sh3f [LIBRARY.sh3f ...]

The libraries are in Debian's package `sweethome3d-furniture`. Only seats and beds are taken, by their names.
"""

import argparse
import csv
import re
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from roam_evaluation.uploads.reading import TABLE

_SEAT = re.compile(
    r"chair|sofa|couch|bench|stool|\bbed\b|bed\d|ottoman|futon|settee|love ?seat|pouf|divan|bunk|lounge", re.I
)
_NOT = re.compile(r"bedside|bed ?table|highchair|high chair|bed ?spread|wheel|crib|lift|work ?bench|table", re.I)
_ENTRY = re.compile(r"(\w+)#(\d+)=(.*)")
_CATEGORIES = ("Characters", "Vehicles", "Doors and windows")


def seats(library: Path) -> Iterator[tuple[dict[str, str], bytes]]:
    """Rows of the table and their files."""
    with zipfile.ZipFile(library) as archive:
        text = archive.read("PluginFurnitureCatalog.properties").decode("latin-1")
        entries: dict[str, dict[str, str]] = {}
        for match in filter(None, (_ENTRY.match(line.strip()) for line in text.splitlines())):
            entries.setdefault(match[2], {})[match[1]] = match[3]
        for entry in entries.values():
            model = entry.get("model", "").lstrip("/")
            words = f"{entry.get('name', '')} {model}"
            if not model.endswith(".obj") or entry.get("category") in _CATEGORIES or model not in archive.namelist():
                continue
            if _SEAT.search(words) and not _NOT.search(words):
                row = {"file": f"{library.stem}_{model.replace('/', '_')}", "name": entry.get("name", "")}
                row |= {"height_m": str(float(entry["height"]) / 100), "up": _up(entry.get("modelRotation"))}
                yield row, archive.read(model)


def _up(rotation: str | None) -> str:
    """The file's axis that a catalogue's rotation (rows of a matrix) turns to +Y."""
    if rotation is None:
        return "y"
    up = np.array([float(word) for word in rotation.split()]).reshape(3, 3)[1]
    axis = int(np.abs(up).argmax())
    return ("-" if up[axis] < 0 else "") + "xyz"[axis]


def main(argv: Sequence[str] | None = None) -> int:
    """Writes the folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("libraries", nargs="+", type=Path)
    options = parser.parse_args(argv)
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for row, data in (found for library in options.libraries for found in seats(library)):
        (options.out / row["file"]).write_bytes(data)
        rows.append(row)
    with (options.out / TABLE).open("w", newline="") as file:
        writer = csv.DictWriter(file, ["file", "name", "height_m", "up"])
        writer.writeheader()
        writer.writerows(rows)
    print(f"{len(rows)} files in {options.out}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
