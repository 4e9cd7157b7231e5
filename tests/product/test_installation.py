"""The wheels work away from the checkout, with everything that they need inside."""

import shutil
import signal
import subprocess
import tomllib
import urllib.request
import zipfile
from pathlib import Path

import pytest
from conftest import ROOT, Installation
from roam_client import __version__

PROJECTS = [ROOT / "pyproject.toml", ROOT / "clients/python/pyproject.toml"]


def test_the_wheel_holds_weights_references_skeletons_limits_and_the_page(wheels: dict[str, Path]):
    names = set(zipfile.ZipFile(wheels["roam-services"]).namelist())
    wanted = {
        "roam_serving/data/weights/field.safetensors",
        "roam_serving/data/weights/motion.safetensors",
        "roam_serving/data/weights/MODEL_CARD.md",
        "roam_serving/data/objects/chair.glb",
        "roam_character/skeletons/humanoid.json",
        "roam_command/viewer/index.html",
        "roam_client/py.typed",
        "roam/v1/motion_pb2.py",
    }
    references = {f"roam_serving/data/references/{path.name}" for path in (ROOT / "examples/references").glob("*.json")}
    limits = {
        str(path.relative_to(ROOT / "services/goalpose"))
        for path in ROOT.glob("services/goalpose/roam_goalpose/energy/**/*.json")
    }
    assert references
    assert limits
    assert (wanted | references | limits) - names == set()
    tops = {name.partition("/")[0] for name in names}
    assert {top for top in tops if not top.startswith("roam")} == set()


def test_both_wheels_hold_the_same_client(wheels: dict[str, Path]):
    light, full = (zipfile.ZipFile(wheels[name]) for name in ("roam-services-client", "roam-services"))
    files = [name for name in light.namelist() if ".dist-info/" not in name]
    assert "roam_client/__init__.py" in files
    assert [name for name in files if light.read(name) != full.read(name)] == []


@pytest.mark.parametrize("project", PROJECTS, ids=["roam-services", "roam-services-client"])
def test_no_dependency_is_a_name_that_only_this_project_uses(project: Path):
    said = tomllib.loads(project.read_text())["project"]
    extras = [item for group in said.get("optional-dependencies", {}).values() for item in group]
    own = [item for item in [*said["dependencies"], *extras] if item.startswith("roam")]
    assert [item for item in own if not item.startswith(f"{said['name']}[")] == []


def test_the_command_says_its_version(product: Installation, client: Installation):
    assert product.run("--version").stdout == f"roam {__version__}\n"
    assert client.run("--version").stdout == f"roam {__version__}\n"
    code = "import roam_goalpose, roam_serving.shipped as s; print(roam_goalpose.__file__, s.checkout())"
    done = product.run("-c", code, program="python")
    assert done.returncode == 0, done.stderr
    where, root = done.stdout.split()
    assert Path(where).is_relative_to(product.folder)
    assert root == "None"


def test_shell_completion_is_there(product: Installation):
    done = product.run("--show-completion", "bash")
    assert done.returncode == 0, done.stderr
    assert "complete" in done.stdout


def test_a_pose_is_made_away_from_the_checkout(product: Installation):
    shutil.copy(ROOT / "examples/objects/chair.glb", product.folder)
    done = product.run("pose", "chair.glb", "-o", "pose.glb")
    assert done.returncode == 0, done.stderr
    assert (product.folder / "pose.glb").read_bytes()[:4] == b"glTF"


def test_the_demo_answers_away_from_the_checkout(product: Installation):
    command = [product.program("roam"), "demo", "--port", "0"]
    process = subprocess.Popen(
        command, cwd=product.folder, env=product.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        address = said.removeprefix("demo: ").strip()
        assert address.startswith("http://127.0.0.1:"), said + process.stderr.read()
        with urllib.request.urlopen(address, timeout=30) as page:
            assert b"<title>" in page.read()
        with urllib.request.urlopen(f"{address}viewer/objects", timeout=30) as objects:
            assert b"sofa" in objects.read()
        with urllib.request.urlopen(f"{address}viewer/objects/0", timeout=30) as chair:
            assert chair.read(4) == b"glTF"
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert process.returncode == 0


@pytest.mark.parametrize(
    "arguments", [["demo"], ["serve"], ["pose", "chair.glb"], ["train", "field"], ["evaluate", "motion"]]
)
def test_a_client_alone_says_what_is_missing(client: Installation, arguments: list[str]):
    shutil.copy(ROOT / "examples/objects/chair.glb", client.folder)
    done = client.run(*arguments)
    assert done.returncode == 2, done.stderr
    said = " ".join(done.stderr.split())
    assert "Traceback" not in said
    assert "the services are not installed here" in said
    assert "roam-services" in said
