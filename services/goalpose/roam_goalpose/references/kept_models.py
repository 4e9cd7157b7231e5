"""Reference models between processes: the eight of an action cost two seconds to make and ten milliseconds to read."""

from functools import cache
from pathlib import Path
from typing import Any

from roam_serving.kept import KeptValues, build_mark, cache_folder

from roam_goalpose.energy.reference import ReferenceModel
from roam_goalpose.energy.terms import TERMS
from roam_goalpose.references.pairs import ReferencePair, ShapeFile

_PACKAGES = ("roam_character", *(f"roam_goalpose.{room}" for room in ("energy", "field", "objects", "references")))
_LIBRARIES = ("numpy", "scipy", "torch", "trimesh")


class KeptModels:
    """Models of shipped pairs in files; those of a caller's own pairs and of added terms are made anew."""

    def __init__(self, field_name: str, folder: Path | None = None) -> None:
        self._field = field_name
        own = all(type(term).__module__.startswith("roam_goalpose.") for term in TERMS.values())
        self._values = KeptValues("references", _build(), folder or cache_folder() if own else None)

    def get(self, pair: ReferencePair, *, seed: int, samples: int) -> ReferenceModel | None:
        """The model, if it was made before by this very build."""
        found: Any = self._values.get(self._key(pair, seed, samples)) if _shipped(pair) else None
        return found if isinstance(found, ReferenceModel) else None

    def put(self, pair: ReferencePair, model: ReferenceModel, *, seed: int, samples: int) -> None:
        """Keeps it."""
        if _shipped(pair) and seed == 0:  # other seeds are many, and seldom asked for twice
            self._values.put(self._key(pair, seed, samples), model)

    def _key(self, pair: ReferencePair, seed: int, samples: int) -> str:
        return f"{self._field} {list(TERMS)} {pair.mark} {seed} {samples}"


def _shipped(pair: ReferencePair) -> bool:
    return isinstance(pair.source, ShapeFile)


@cache
def _build() -> str:
    return build_mark(_PACKAGES, _LIBRARIES)
