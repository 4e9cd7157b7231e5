"""The client installs alone: its declared dependencies are all it needs, and its wheel has everything in it."""

import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import distribution, packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement

PROJECT = Path(__file__).parents[2] / "clients/python"

BLOCKED = """
import sys
allowed = set({allowed!r}) | set(sys.stdlib_module_names)

class OnlyDeclared:
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top not in allowed and not top.startswith(("_", "google")):
            raise ImportError(f"{{name}} is not a dependency of roam-services-client")
        return None

sys.meta_path.insert(0, OnlyDeclared())
import roam_client, roam_command.main
with roam_client.Client(goalpose="127.0.0.1:1", timeout=1) as client:
    try:
        client.reference_poses()
    except roam_client.ConnectionFailedError:
        print("usable")
heavy = [name for name in ("torch", "trimesh", "scipy", "fastapi") if name in sys.modules]
assert not heavy, heavy
"""


def closure(name: str, seen: set[str]) -> set[str]:
    """The distribution and everything it depends on in this environment."""
    if name in seen:
        return seen
    seen.add(name)
    for text in distribution(name).requires or []:
        requirement = Requirement(text)
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
            closure(requirement.name.lower().replace("_", "-"), seen)
    return seen


def test_declared_dependencies_are_all_it_needs():
    declared = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]["dependencies"]
    distributions: set[str] = set()
    for text in declared:
        closure(Requirement(text).name.lower(), distributions)
    assert {"numpy", "grpcio", "protobuf"} <= distributions
    assert not {"torch", "trimesh", "scipy", "fastapi", "httpx", "roam-services"} & distributions
    top_levels = [
        top
        for top, owners in packages_distributions().items()
        if distributions & {owner.lower().replace("_", "-") for owner in owners}
    ]
    code = BLOCKED.format(allowed=[*top_levels, "roam", "roam_client", "roam_command"])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["usable"]


def test_the_wheel_has_the_page_and_the_stubs(tmp_path: Path):
    pytest.importorskip("hatchling", reason="needs hatchling to build the wheel without a network")
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", tmp_path, PROJECT]
    subprocess.run(command, check=True, timeout=300, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    wanted = (
        "roam_client/py.typed",
        "roam/v1/motion_pb2.py",
        "roam/v1/motion_pb2.pyi",
        "roam_command/viewer/index.html",
        "roam_command/viewer/main.js",
        "roam_command/viewer/vendor/three/three.module.js",
        "roam_command/viewer/vendor/three/LICENSE",
    )
    assert [name for name in wanted if name not in names] == []
    assert not [name for name in names if name.startswith(("tests", "services", "build"))]
