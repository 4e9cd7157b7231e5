"""A reader from elsewhere, registered in one file, works end to end: name, content, child process, HTTP service."""

import importlib
from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import numpy as np
import pytest
import toy_reader
from roam_goalpose.app import GoalPoseService
from roam_goalpose.objects import FORMATS, IsolatedLoader, ObjectError, format_of
from roam_goalpose.settings import GoalPoseSettings
from roam_goalpose.synthesis import Synthesizer
from roam_serving.server import Addresses, running

STOOL = b"""BOXES
-0.2 0.42 -0.2 0.4 0.03 0.4
-0.2 0.45 -0.2 0.4 0.45 0.03
-0.2 0 -0.2 0.04 0.42 0.04
0.16 0 -0.2 0.04 0.42 0.04
-0.2 0 0.16 0.04 0.42 0.04
0.16 0 0.16 0.04 0.42 0.04
"""
SIZE = [0.4, 0.9, 0.4]


@pytest.fixture
async def addresses(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Addresses]:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "goalpose"))
    poser = importlib.import_module("poser")
    monkeypatch.setattr(Synthesizer, "load", classmethod(lambda cls, settings: poser.Poser()))
    settings = GoalPoseSettings()
    async with running([GoalPoseService(settings)], settings) as addresses:
        yield addresses


def test_it_is_in_the_registry():
    assert toy_reader.read_boxes.__module__ == "toy_reader"
    assert "boxes" in FORMATS
    assert format_of("stool.BOXES") == "boxes"


def test_it_runs_in_the_child_process():
    with IsolatedLoader() as loader:
        shape = loader.load(STOOL, "boxes")
        np.testing.assert_allclose(np.ptp(shape.bounds, axis=0), SIZE, atol=1e-4)
        with pytest.raises(ObjectError) as caught:
            loader.load(b"BOXES\n1 2 three\n", "boxes")
    assert "is no box" in caught.value.message


async def test_it_works_through_the_service(addresses):
    async with httpx.AsyncClient(base_url=addresses.http, timeout=60) as client:
        answer = await client.post("/v1/objects", content=STOOL)  # known by its first bytes
        assert answer.status_code == 201, answer.text
        assert answer.json()["format"] == "boxes"
        low, high = answer.json()["bounds"]
        np.testing.assert_allclose(np.subtract(high, low), SIZE, atol=1e-4)
        files = {"file": ("stool.boxes", STOOL)}
        assert (await client.post("/v1/objects", files=files)).json()["name"] == answer.json()["name"]
