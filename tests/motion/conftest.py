"""A motion server on free ports, run by the stand-in animator of `walker`."""

import pytest
from motion.app import MotionService
from motion.settings import MotionSettings
from motion.step import Animator
from serving.server import running
from walker import Walker


@pytest.fixture
async def motion_addresses(monkeypatch, tmp_path):
    """Where a real server listens whose characters slide instead of walk."""
    monkeypatch.setattr(Animator, "load", staticmethod(lambda path: Walker()))
    weights = tmp_path / "weights.safetensors"
    weights.write_bytes(b"none needed")
    settings = MotionSettings(motion_weights=str(weights))
    async with running([MotionService(settings)], settings) as addresses:
        yield addresses
