"""Where the real data lie, for the few tests that need them; one thread for tensors, as servers have; and a folder of
the tests' own for what processes keep for one another."""

import os
import tempfile
from pathlib import Path

# With more, sums are split otherwise and round otherwise: frames computed here would not be those of a server.
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["ROAM_CACHE"] = str(Path(tempfile.gettempdir()) / f"roam-tests-{os.getuid()}")

import pytest


def _data(folder: str) -> Path:
    root = Path(os.environ.get("ROAM_DATA", Path(__file__).parents[2] / "shared"))
    if not (root / folder).is_dir():
        pytest.skip(f"needs the real data: set ROAM_DATA to a folder that contains {folder}/")
    return root / folder


@pytest.fixture
def mocap() -> Path:
    """The folder of motion-capture clips, or a skip."""
    return _data("mocap")


@pytest.fixture
def objects() -> Path:
    """The folder of furniture meshes, or a skip."""
    return _data("objects")
