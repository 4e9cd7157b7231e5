"""A goal pose server on free ports, run by the stand-in synthesizer of `poser`."""

import pytest
from poser import Poser
from roam_goalpose.app import GoalPoseService
from roam_goalpose.settings import GoalPoseSettings
from roam_goalpose.synthesis import Synthesizer
from roam_serving.server import running


@pytest.fixture
def poser():
    """The synthesizer behind `goalpose_addresses`."""
    return Poser()


@pytest.fixture
async def goalpose_addresses(monkeypatch, poser):
    """Where a real server listens that solves nothing."""
    monkeypatch.setattr(Synthesizer, "load", classmethod(lambda cls, settings: poser))
    settings = GoalPoseSettings(max_upload_bytes=200_000, queue_limit=2, max_inline_points=1000, isolate_uploads=False)
    async with running([GoalPoseService(settings)], settings) as addresses:
        yield addresses
