"""Motion in a process beside the command: it answers, it ends with the command, and says when it cannot start."""

import pytest
from roam_client import Client, RoamError
from roam_command.motion_process import MotionProcess


def test_it_answers_and_ends_with_the_command() -> None:
    with MotionProcess() as process, Client(motion=process.address) as client:
        assert client.server_info("motion").services == ("motion",)
    assert process.ended


def test_what_cannot_start_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROAM_MOTION_WEIGHTS", "no such file")
    with MotionProcess() as process, pytest.raises(RoamError, match="could not start"):
        _ = process.address
