"""Characters of our own making as files and as rigs."""

from collections.abc import Callable
from pathlib import Path

import pytest
from rig_maker import character
from roam_character.documents.gltf_document import GltfDocument
from roam_character.rigs.reading import read_rig
from roam_character.rigs.rig import Rig


@pytest.fixture
def rig_of(tmp_path: Path) -> Callable[..., Rig]:
    """A rig read from a file that `character(**options)` makes, or from a given document."""

    def make(document: GltfDocument | None = None, *, ending: str = "glb", **options: object) -> Rig:
        path = tmp_path / f"hero.{ending}"
        path.write_bytes((document or character(**options)).to_bytes())  # type: ignore[arg-type]
        return read_rig(path)

    return make
