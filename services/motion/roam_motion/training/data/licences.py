"""Which clips may be trained on together: share-alike material goes into weights of its own, under its licence."""

import csv
from collections.abc import Sequence
from pathlib import Path

APACHE, SHARE_ALIKE = "Apache-2.0", "CC-BY-SA-3.0"
# Folders of the project's own data set that hold or are composed of HDM05 (CC BY-SA 3.0).
_KNOWN = ("hdm05", "derived_lie2")
_NOTICES = ("LICENCE*", "LICENSE*")
_MARKS = ("by-sa", "sharealike", "share-alike", "share alike")


class LicenceError(ValueError):
    """Folders that may not go into the same weights."""


def share_alike(folder: Path) -> bool:
    """Whether a folder's clips are under a share-alike licence: by its name, its notice or its table."""
    if folder.name.startswith(_KNOWN):
        return True
    notices = [path for pattern in _NOTICES for path in sorted(folder.glob(pattern)) if path.is_file()]
    texts = [path.read_text(errors="replace") for path in notices]
    table = folder / "CATALOG.csv"
    if table.exists():
        with table.open(newline="") as file:
            texts += [row.get("licence") or "" for row in csv.DictReader(file)]
    return any(mark in text.lower().replace(" by sa", " by-sa") for text in texts for mark in _MARKS)


def licence_of(folders: Sequence[str], *, allowed: bool) -> str:
    """The licence of weights trained on `folders`. LicenceError for share-alike ones that were not asked for."""
    found = [folder for folder in folders if share_alike(Path(folder))]
    if found and not allowed:
        names = ", ".join(Path(folder).name for folder in found)
        raise LicenceError(
            f"{names}: share-alike clips (CC BY-SA). Weights trained on them are under that licence: leave these "
            "folders out, or ask for such weights with --share-alike and keep them in a file of their own"
        )
    return SHARE_ALIKE if found else APACHE
