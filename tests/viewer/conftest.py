"""A running demo and a browser to look at it with."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

WEIGHTS = Path(__file__).parents[2] / "weights/motion.safetensors"
CHAIR = Path(__file__).parents[2] / "examples/objects/chair.glb"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Software rendering: a test machine has no graphics card.
FLAGS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


@pytest.fixture(scope="module")
def demo() -> Iterator[str]:
    """Address of the page, with both services behind it."""
    if not WEIGHTS.exists():
        pytest.skip("needs the motion weights: weights/motion.safetensors")
    from roam_command.embedded import running_in_thread
    from roam_command.page import PageService, Upload
    from roam_goalpose.app import GoalPoseService
    from roam_goalpose.settings import GoalPoseSettings
    from roam_motion.app import MotionService
    from roam_motion.settings import MotionSettings
    from stub_poses import KnownAnswer

    settings = GoalPoseSettings()
    services = [
        GoalPoseService(settings),
        MotionService(MotionSettings(step_process=False)),
        PageService(Upload(CHAIR)),
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("roam_goalpose.app.Synthesizer", KnownAnswer)
        with running_in_thread(services, settings) as addresses:
            yield addresses.http


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Headless Chromium."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs the playwright package to drive a browser")
    path = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip("needs Chromium to see the page (Debian: apt install chromium)")
    with playwright.sync_playwright() as running:
        chromium = running.chromium.launch(executable_path=path, args=[*FLAGS, "--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def tab(browser: Any, demo: str) -> Iterator[Any]:
    """The page, open."""
    tab = browser.new_page(viewport={"width": 860, "height": 480})
    complaints: list[str] = []
    tab.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    tab.complaints = complaints
    tab.set_default_timeout(120_000)
    tab.goto(demo)
    yield tab
    tab.close()


@pytest.fixture
def page(tab: Any) -> Iterator[Any]:
    """The page; it fails the test when it complains."""
    tab.complaints.clear()
    yield tab
    assert tab.complaints == []
