"""`roam serve` as a process with the shipped networks, and everything a newcomer would do with it."""

import importlib.util
import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from roam_client import Action, Client
from roam_command.main import app
from typer.testing import CliRunner

ROOT = Path(__file__).parents[2]
CHAIR = ROOT / "examples/objects/chair.glb"
pytestmark = pytest.mark.timeout(600)


@dataclass(frozen=True)
class Served:
    """Addresses of the running pair."""

    http: str
    grpc: str


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    missing = [name for name in ("field", "motion") if not (ROOT / f"weights/{name}.safetensors").exists()]
    if missing:
        pytest.skip(f"needs the shipped weights: {', '.join(missing)}")
    command = [sys.executable, "-m", "roam_command", "serve", "--http-port", "0", "--grpc-port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        ready = re.match(r"ready http=(\S+) grpc=(\S+)", process.stdout.readline())
        assert ready, "the first line says where the services are"
        yield Served(ready[1], ready[2])
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=60) == 0


@pytest.fixture(scope="module")
def sat(served: Served, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, Path]:
    """One `roam sit`, saved in every format."""
    folder = tmp_path_factory.mktemp("sit")
    files = [text for ending in ("npz", "glb", "bvh", "json") for text in ("-o", str(folder / f"sit.{ending}"))]
    result = CliRunner().invoke(app, ["sit", str(CHAIR), "--server", served.grpc, "--json", "--seed", "1", *files])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout), folder


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / f"examples/{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_character_sits_on_the_bundled_chair(sat: tuple[dict, Path]):
    answer, folder = sat
    assert answer["reached"]
    assert answer["final_position_error"] < 0.05
    assert answer["hip_seat_distance"] < 0.08
    with np.load(folder / "sit.npz", allow_pickle=False) as saved:
        arrays = dict(saved)
    frames, joints = answer["frames"], len(arrays["joint_names"])
    shapes = {name: array.shape for name, array in arrays.items()}
    assert shapes["root_position"] == (frames, 3)
    assert shapes["rotations"] == (frames, joints, 4)
    assert shapes["joint_positions"] == (frames, joints, 3)
    assert shapes["contacts"] == (frames, 4)
    assert shapes["action"] == (frames,)
    assert shapes["goal_joint_positions"] == (joints, 3)
    np.testing.assert_allclose(arrays["object_to_world"], np.eye(4), atol=1e-9)
    assert arrays["fps"] == 30
    np.testing.assert_allclose(np.linalg.norm(arrays["rotations"], axis=-1), 1, atol=1e-3)
    # it stands on the floor at the start, three metres from the goal, and sits at the end
    assert 0.7 < arrays["root_position"][0, 1] < 1.1
    away = np.linalg.norm((arrays["root_position"][0] - arrays["goal_joint_positions"][0])[[0, 2]])
    assert away == pytest.approx(3, abs=0.2)
    assert arrays["action"][-1] == Action.SIT


def test_the_saved_files_agree(sat: tuple[dict, Path]):
    from roam_character.documents.bvh import read_bvh

    answer, folder = sat
    clip = read_bvh(folder / "sit.bvh")
    with np.load(folder / "sit.npz") as saved:
        assert len(clip) == len(saved["root_position"]) == answer["frames"]
        read = json.loads((folder / "sit.json").read_text())
        np.testing.assert_allclose(read["joint_positions"], saved["joint_positions"], atol=1e-5)
        names = list(clip.skeleton.joint_names)
        columns = [names.index(name) for name in saved["joint_names"]]
        np.testing.assert_allclose(clip.positions()[:, columns], saved["joint_positions"], atol=0.01)


def test_positions_on_the_wire_are_those_of_the_skeleton(served: Served):
    with Client(goalpose=served.grpc, motion=served.grpc, timeout=120) as client:
        assert {pose.id for pose in client.reference_poses()} >= {"chair_sit", "sofa_sit", "sofa_lie"}
        assert set(client.server_info("goalpose").services) == {"goalpose", "motion"}
        with client.create_session(floor_height=0.5) as session:
            with session.stream(pacing="credit", joint_positions=True) as stream:
                frame = next(stream.frames())
            computed = stream.header.skeleton.joint_positions(frame.root_position, frame.rotations)
            np.testing.assert_allclose(frame.joint_positions, computed, atol=1e-4)
            assert frame.joint_positions[:, 1].min() > 0.45  # it stands on the floor it was given


def test_the_rest_example(served: Served):
    pose = example("rest_pose").goal_pose(served.http, CHAIR)
    assert pose["action"] == "sit"
    assert pose["diagnostics"]["hip_seat_distance"] < 0.1


async def test_the_streaming_example(served: Served):
    frames = await example("stream_motion").perform(served.grpc, CHAIR, seconds=300)
    assert {Action.WALK, Action.SIT} <= {frame.action for frame in frames}
    assert frames[-1].action is Action.IDLE


def test_the_baking_example(served: Served):
    with Client(goalpose=served.grpc, motion=served.grpc, timeout=120) as client:
        motion = example("bake_motion").bake(client, CHAIR)
    assert motion.goal_reached is not None


def test_the_bundled_objects_are_furniture():
    from roam_goalpose.objects import load_shape

    made = example("make_objects")
    files = sorted(made.OBJECTS.glob("*.glb"))
    assert [path.stem for path in files] == sorted(made.PIECES)
    for path in files[:2]:
        shape = load_shape(path.read_bytes(), "glb")
        assert shape.floor_height == pytest.approx(0, abs=1e-3)
        assert shape.warnings == ()
