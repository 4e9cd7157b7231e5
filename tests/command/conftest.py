"""The command against the client's fake services: quick, and without any model."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "client"))

from fake_services import Fake, fake_services


@pytest.fixture
def fake() -> Iterator[Fake]:
    with fake_services() as running:
        yield running


@pytest.fixture
def chair(tmp_path: Path) -> Path:
    """A file that the fake takes for a chair; its cube is real enough for a display mesh."""
    path = tmp_path / "chair.obj"
    corners = [(x, y, z) for x in (0, 50) for y in (0, 100) for z in (0, 50)]
    faces = [(1, 3, 2), (2, 3, 4), (5, 6, 7), (6, 8, 7), (1, 2, 5), (2, 6, 5), (3, 7, 4), (4, 7, 8)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join(lines))
    return path
