"""Programs that open our files, where they are installed; a test that needs one that is not says so and is skipped.

ROAM_TEST_NODE_MODULES: a folder with the npm packages gltf-validator, three, @pixiv/three-vrm and
@pixiv/three-vrm-animation. ROAM_BLENDER: a `blender` program, or a Python that has bpy.
"""

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from roam_character.clip import Clip
from roam_character.formats.fbx import blender_command
from roam_character.rotation import quat_from_rotvec
from roam_character.skeleton import humanoid_skeleton


@pytest.fixture
def turning() -> Clip:
    """Forty frames at 30 Hz: a whole turn about the vertical, an arm through ±90°, a leg through -90°."""
    skeleton, time = humanoid_skeleton(), np.arange(40) / 30
    vectors = np.zeros((40, skeleton.joint_count, 3))
    vectors[:, skeleton.index("leftUpperArm"), 2] = 1.6 * np.sin(3 * time)
    vectors[:, skeleton.index("rightLowerArm"), 1] = 2.0 * np.sin(4 * time)
    vectors[:, skeleton.index("leftUpperLeg"), 0] = -1.6 * np.sin(3 * time)
    vectors[:, 0, 1] = 5 * time
    roots = np.stack([0.1 * time, 0.96 + 0.0 * time, time], axis=-1)
    return Clip(skeleton, 30.0, roots.astype(np.float32), quat_from_rotvec(vectors).astype(np.float32))


@pytest.fixture(scope="session")
def node(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """Runs a script of JavaScript with some npm packages; its last line of output as JSON."""
    folder = os.environ.get("ROAM_TEST_NODE_MODULES", "")
    program = shutil.which("node")

    def run(script: str, *arguments: str, needs: str) -> Any:
        if program is None:
            pytest.skip("node is not installed")
        if not (Path(folder) / needs).is_dir() or not folder:
            pytest.skip(f"npm package {needs} is not in ROAM_TEST_NODE_MODULES")
        path = tmp_path_factory.mktemp("node") / "script.cjs"
        path.write_text(script)
        environment = {**os.environ, "NODE_PATH": folder}
        done = subprocess.run(
            [program, str(path), *arguments], capture_output=True, text=True, timeout=120, env=environment, check=False
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout.strip().splitlines()[-1])

    return run


@pytest.fixture(scope="session")
def blender(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """Runs a script in Blender; its last line of output as JSON."""

    def run(script: str, *arguments: str) -> Any:
        command = blender_command()
        if not command:
            pytest.skip("Blender is not installed (blender on PATH, bpy, or ROAM_BLENDER)")
        path = tmp_path_factory.mktemp("blender") / "script.py"
        path.write_text(script)
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        done = subprocess.run(
            [*command, str(path), "--", *arguments], capture_output=True, text=True, timeout=280, env=environment,
            check=False,
        )  # fmt: skip
        found = [line for line in done.stdout.splitlines() if line.startswith("{")]
        assert found, done.stdout[-2000:] + done.stderr[-2000:]
        return json.loads(found[-1])

    return run
