"""Settings that are wrong are one sentence and exit code 2, before anything is loaded."""

import os
import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from roam_goalpose.settings import GoalPoseSettings
from roam_motion.settings import MotionSettings
from roam_serving.settings import (
    OTHER_VARIABLES,
    ServerSettings,
    SettingsError,
    check_environment,
    read_settings,
    setting_names,
)

ROOT = Path(__file__).parents[2]
VARIABLE = re.compile(r"\bROAM_[A-Z_]*[A-Z]\b")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("ROAM_HTP_PORT", "did you mean ROAM_HTTP_PORT"),
        ("ROAM_SESION_STORE", "did you mean ROAM_SESSION_STORE"),
        ("ROAM_ZEBRA", "--help"),
    ],
)
def test_a_misspelt_variable_is_refused(name: str, words: str):
    with pytest.raises(SettingsError, match=f"{name} is set.*{words}"):
        check_environment({name: "1", "PATH": "/bin"})


@pytest.mark.parametrize(
    "name",
    ["ROAM_MAX_COUNT", "ROAM_API_KEY", "ROAM_TEST_COMPOSE", "ROAM_MOTION_SERVICE_HOST", "ROAM_MOTION_PORT_80_TCP"],
)
def test_what_somebody_reads_is_taken(name: str):
    check_environment({name: "1"})
    check_environment({"ROAM_MOTION_PORT": "tcp://10.0.0.7:80"})


def test_every_server_knows_the_settings_of_all():
    fields = {f"ROAM_{name.upper()}" for kind in (GoalPoseSettings, MotionSettings) for name in kind.model_fields}
    assert fields <= setting_names()


def test_the_repository_names_no_variable_that_nobody_knows():
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if listing.returncode:
        pytest.skip("not a git checkout, so there is no list of files to read")
    known = setting_names() | OTHER_VARIABLES
    unknown = {}
    for name in listing.stdout.decode().split("\0"):
        path = ROOT / name
        if (
            path == Path(__file__)
            or path.suffix not in {".py", ".md", ".yml", ".yaml", ".sh", ""}
            or not path.is_file()
        ):
            continue
        found = {word for word in VARIABLE.findall(path.read_text()) if not word.startswith("ROAM_TEST_")}
        unknown |= dict.fromkeys(found - known, name)
    assert unknown == {}


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("ROAM_HTTP_PORT", "abc", "ROAM_HTTP_PORT cannot be 'abc': input should be a valid integer"),
        ("ROAM_DRAIN_SECONDS", "-1", "ROAM_DRAIN_SECONDS cannot be '-1'.*greater than or equal to 0"),
        ("ROAM_LOG_LEVEL", "loud", "ROAM_LOG_LEVEL cannot be 'loud'.*'debug'"),
    ],
)
def test_a_wrong_value_names_its_variable(monkeypatch: pytest.MonkeyPatch, name: str, value: str, words: str):
    monkeypatch.setenv(name, value)
    with pytest.raises(SettingsError, match=words):
        read_settings(ServerSettings)


def test_a_wrong_argument_names_its_option():
    with pytest.raises(SettingsError, match="--max-sessions cannot be 0"):
        read_settings(MotionSettings, max_sessions=0)


def start(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Starts a program of the services that is not to come up."""
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    } | variables
    return subprocess.run(
        [sys.executable, "-m", *arguments], env=environment, capture_output=True, text=True, timeout=280, check=False
    )


def assert_one_sentence(done: subprocess.CompletedProcess[str], words: str) -> None:
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
    lines = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1, done.stderr
    assert re.search(words, " ".join(done.stderr.split())), done.stderr


def test_a_busy_port_is_one_sentence():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert_one_sentence(start("roam_motion.app", "--http-port", port), f"cannot listen on 127.0.0.1:{port}")
        assert_one_sentence(start("roam_command", "demo", "--port", port), f"cannot listen on 127.0.0.1:{port}")


def test_wrong_settings_end_a_server_with_one_sentence():
    assert_one_sentence(start("roam_motion.app", ROAM_MAX_SESSIONS="many"), "ROAM_MAX_SESSIONS cannot be 'many'")
    assert_one_sentence(start("roam_command", "serve", ROAM_HTP_PORT="1"), "did you mean ROAM_HTTP_PORT")


def test_weights_of_something_else_are_one_sentence():
    readme = str(ROOT / "README.md")
    assert_one_sentence(
        start("roam_motion.app", ROAM_MOTION_WEIGHTS=readme), "README.md does not hold weights of the motion"
    )
