"""A motion server on free ports, run by the stand-in animator of `walker`."""

import pytest
from roam_motion.animator import Animator
from roam_motion.app import MotionService
from roam_motion.settings import MotionSettings
from roam_serving.server import running
from walker import Walker


@pytest.fixture
def motion_service(monkeypatch, tmp_path):
    """The service, its animator replaced."""
    monkeypatch.setattr(Animator, "load", staticmethod(lambda path: Walker()))
    weights = tmp_path / "weights.safetensors"
    weights.write_bytes(b"none needed")
    return MotionService(MotionSettings(motion_weights=str(weights), step_process=False))


@pytest.fixture
async def motion_addresses(motion_service):
    """Where a real server listens whose characters slide instead of walk."""
    async with running([motion_service], MotionSettings()) as addresses:
        yield addresses
