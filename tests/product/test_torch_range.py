"""torch is a range: the pinned default lies in it, and both ends give the default's answers.

ROAM_TEST_TORCH names interpreters whose torch is to be tried, separated as in PATH: one for each end of the range. The
other packages come from the environment of the tests.
"""

import json
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from packaging.requirements import Requirement
from packaging.version import Version

PROGRAM = Path(__file__).parent / "pose_and_walk.py"
INTERPRETERS = [path for path in os.environ.get("ROAM_TEST_TORCH", "").split(os.pathsep) if path]


def torch_range() -> Requirement:
    """What pyproject.toml asks for."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return next(r for r in map(Requirement, project["dependencies"]) if r.name == "torch")


@cache
def answer(interpreter: str) -> dict[str, Any]:
    """What the program prints there; packages other than torch are lent."""
    lent = os.pathsep.join([*filter(None, sys.path), sysconfig.get_path("purelib")])
    own = subprocess.run(
        [interpreter, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join([own.stdout.strip(), lent])}
    done = subprocess.run(
        [interpreter, str(PROGRAM)], env=environment, capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_default_lies_in_the_range():
    pinned = re.search(r"^torch==(\S+)$", (ROOT / "requirements/pins.txt").read_text(), re.MULTILINE)
    assert pinned
    assert pinned.group(1) in torch_range().specifier


@pytest.mark.skipif(not INTERPRETERS, reason="ROAM_TEST_TORCH names no interpreter with another torch")
@pytest.mark.parametrize("interpreter", INTERPRETERS)
def test_another_torch_gives_the_same_pose_and_motion(interpreter: str):
    default, other = answer(sys.executable), answer(interpreter)
    assert Version(other["torch"]) in torch_range().specifier
    np.testing.assert_allclose(other["goal_pose"], default["goal_pose"], atol=1e-3)  # [m] and quaternion components
    np.testing.assert_allclose(other["frame"], default["frame"], atol=1e-3)


@pytest.mark.skipif(len(INTERPRETERS) < 2, reason="ROAM_TEST_TORCH names no interpreters for both ends of the range")
def test_the_interpreters_are_the_ends_of_the_range():
    tried = {Version(answer(path)["torch"]).release[:2] for path in INTERPRETERS}
    ends = {Version(part.version) for part in torch_range().specifier if part.operator == ">="}
    assert {end.release[:2] for end in ends} <= tried
    assert max(tried) > max(Version(answer(sys.executable)["torch"]).release[:2], min(tried))
