"""The Python client passes the sessions that every client must pass, and the sessions find one that does not."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "clients/conformance"
DRIVER = [sys.executable, str(FOLDER / "python_driver.py")]
# Each forgets one thing that a client must do; the sessions named find it.
FORGETFUL = {
    "resume": "stream_state.StreamState.opening = lambda self: motion_pb2.Open(session=self.session)",
    "repeat": "stream_state.StreamState.after_sequence = property(lambda self: 0, lambda self, value: None)",
    "control-once": "stream_state.StreamState._confirm = lambda self, last: None",
    "control-again": "stream_state.StreamState.control = lambda self, c: motion_pb2.AnimateRequest(control=c)",
    "acknowledge": "stream_state.StreamState._acknowledge = lambda self, credit: None",
    "silence": "stream_state.StreamState.patience = None",
    "error": "transport.breaks_stream = base_stream.breaks_stream = lambda error: True",
}


def conform(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(FOLDER / "run.py"), *words]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240, check=False)


@pytest.mark.parametrize("half", [[], ["--asyncio"]], ids=["sync", "asyncio"])
def test_the_python_client_conforms(half: list[str]):
    done = conform("--", *DRIVER, *half)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == f"{len(list(FOLDER.glob('sessions/*.json')))} passed, 0 failed"


@pytest.mark.parametrize("session", FORGETFUL)
def test_a_client_that_forgets_something_does_not(session: str, tmp_path: Path):
    driver = tmp_path / "forgetful.py"
    driver.write_text(
        f"import sys; sys.path.insert(0, {str(FOLDER)!r})\n"
        "from roam.v1 import motion_pb2\n"
        "from roam_client.connection import transport\n"
        "from roam_client.streams import base_stream, stream_state\n"
        f"{FORGETFUL[session]}\n"
        "import python_driver\n"
        "sys.exit(python_driver.main())\n"
    )
    done = conform("--only", session, "--", sys.executable, str(driver))
    assert done.returncode == 1, done.stdout + done.stderr
    assert f"failed  {session}" in done.stdout
