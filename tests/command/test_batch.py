"""`roam batch`: resumable, one line per object, failures listed and never fatal, on both engines."""

import errno
import importlib.util
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from roam.v1 import goal_pose_pb2
from roam_client.types.files import save_arrays
from roam_command.commands.batch import command
from roam_command.commands.batch import engines as batch_engines
from roam_command.commands.batch import ledger as batch_ledger
from roam_command.commands.batch.engines import local
from roam_command.commands.batch.ledger import Ending, Ledger
from roam_command.commands.batch.work import Order, Outcome, digest_of
from roam_command.main import app
from typer.testing import CliRunner

ROOT = Path(__file__).parents[2]
ORDER = Order(reference=None, action="sit", seed=0, unit=None, up=None)


def work(data: bytes, format: str, order: Order) -> Outcome:
    """Stands in for a synthesis: the file's content says what happens. Runs in the engine's processes."""
    if data == b"kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if data == b"bad":
        return Outcome(reason="OBJECT_MALFORMED", message="It is bad.")
    return Outcome(goal_pose=data + order.action.encode(), seconds=1.0)


def files(folder: Path, contents: dict[str, bytes]) -> list[Path]:
    for name, content in contents.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return [folder / name for name in contents]


def test_a_dying_process_fails_one_object_only(tmp_path: Path):
    sources = files(tmp_path, {f"{n}.obj": b"kill" if n == 2 else b"good" for n in range(6)} | {"x.ply": b"bad"})
    outcomes = {source.name: outcome for source, outcome in local(sources, ORDER, jobs=2, work=work)}
    assert set(outcomes) == {source.name for source in sources}
    assert outcomes.pop("2.obj").reason == "INTERNAL"
    assert outcomes.pop("x.ply").reason == "OBJECT_MALFORMED"
    assert {outcome.goal_pose for outcome in outcomes.values()} == {b"goodsit"}


@pytest.fixture
def shelf(tmp_path: Path) -> Path:
    """A folder with one real chair between things that are none."""
    folder = tmp_path / "shelf"
    chair = (ROOT / "examples/objects/chair.glb").read_bytes()
    flat = trimesh.creation.box((0.5, 0.0001, 0.5)).export(file_type="stl")
    files(folder, {"chairs/chair.glb": chair, "chairs/broken.glb": chair[:-99], "flat.stl": flat, "notes.txt": b"x"})
    return folder


def roam_batch(*arguments: object, exit_code: int = 0) -> list[dict]:
    result = CliRunner().invoke(app, ["batch", *map(str, arguments), "--json"])
    assert result.exit_code == exit_code, result.output
    return [json.loads(line) for line in result.stdout.splitlines()]


@pytest.mark.skipif(not (ROOT / "weights/field.safetensors").exists(), reason="weights/field.safetensors is not there")
def test_a_folder_from_end_to_end_and_again(shelf: Path, tmp_path: Path):
    out = tmp_path / "poses"
    first = {record["file"]: record for record in roam_batch(shelf, "-o", out, "--reference", "chair_sit", "--jobs", 1)}
    assert {name: record["status"] for name, record in first.items()} == {
        "chairs/broken.glb": "failed",
        "chairs/chair.glb": "done",
        "flat.stl": "failed",
    }
    assert first["chairs/broken.glb"]["reason"] == "OBJECT_MALFORMED"
    assert first["chairs/chair.glb"]["hip_seat_distance"] < 0.08
    with np.load(out / "chairs/chair.pose.npz", allow_pickle=False) as saved:
        assert saved["rotations"].shape == (22, 4)
    ledger = (out / "batch.jsonl").read_text().splitlines()
    assert [json.loads(line)["file"] for line in ledger] == list(first)

    with (out / "batch.jsonl").open("a") as file:
        file.write('{"file": "chairs/cha')  # killed while writing
    again = roam_batch(shelf, "-o", out, "--reference", "chair_sit", "--jobs", 1)
    assert {record["file"] for record in again} == {"chairs/broken.glb", "flat.stl"}
    assert len((out / "batch.jsonl").read_text().splitlines()) == 6


def test_what_is_done_is_told_by_content_and_options(shelf: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def run(left, order, *, jobs):
        for source in left:
            asked.append(source.name)
            yield source, Outcome(reason="NOT_TODAY")

    asked: list[str] = []
    monkeypatch.setattr(batch_engines, "local", run)
    out = tmp_path / "poses"
    out.mkdir()
    chair = shelf / "chairs/chair.glb"
    (out / "chairs").mkdir()
    (out / "chairs/chair.pose.npz").touch()
    record = {
        "file": "chairs/chair.glb",
        "status": "done",
        "content": digest_of(chair.read_bytes()),
        "order": ORDER.record(),
    }
    record["pose"] = digest_of(b"")
    (out / "batch.jsonl").write_text(json.dumps(record) + "\n")

    def tried(*options: object) -> set[str]:
        asked.clear()
        result = CliRunner().invoke(app, ["batch", str(shelf), "-o", str(out), *map(str, options)])
        assert result.exit_code == (1 if len(asked) == 3 else 0), result.output
        return set(asked)

    rest = {"broken.glb", "flat.stl"}
    assert tried() == rest
    assert tried("--seed", 1) == rest | {"chair.glb"}
    (out / "batch.jsonl").write_text(json.dumps(record) + "\n")
    chair.write_bytes(chair.read_bytes() + b"\0")
    assert tried() == rest | {"chair.glb"}


def test_a_pose_that_is_another_one_is_made_again(shelf: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    out = tmp_path / "poses"
    source = shelf / "chairs/chair.glb"
    ledger = Ledger(out, shelf, ORDER, Ending.NPZ, [source])
    monkeypatch.setattr(batch_ledger, "write_pose", lambda target, *_, **__: target.write_bytes(b"whole"))
    monkeypatch.setattr(batch_ledger, "goal_pose_figures", lambda goal: {})
    monkeypatch.setattr(batch_ledger.GoalPose, "from_message", lambda *_, **__: None)
    place = goal_pose_pb2.Object(object_to_world=np.eye(4).ravel()).SerializeToString()
    done = Outcome(object=place, goal_pose=b"\n\x00", content=digest_of(source.read_bytes()))
    assert ledger.add(source, done, None)["status"] == "done"
    assert Ledger(out, shelf, ORDER, Ending.NPZ, [source]).has(source)
    ledger.target(source).write_bytes(b"who")  # cut off, or of another run
    assert not Ledger(out, shelf, ORDER, Ending.NPZ, [source]).has(source)


def test_a_full_disk_leaves_no_file_and_names_it(shelf: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    target = tmp_path / "pose.npz"
    target.write_bytes(b"the old one")

    def full(part: Path, **_: object) -> None:
        part.write_bytes(b"hal")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(OSError, match=r"cannot write .*pose\.npz: No space left on device"):
        save_arrays(target, {"a": np.zeros(3)}, {})
    assert target.read_bytes() == b"the old one"
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["pose.npz"]


def test_exit_codes_tell_whether_anything_was_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def run(left, order, *, jobs):
        yield from ((source, Outcome(reason="NOT_TODAY")) for source in left)

    monkeypatch.setattr(batch_engines, "local", run)
    folder = tmp_path / "shelf"
    files(folder, {"a.obj": b"a", "b.obj": b"b", "c.blend": b"c"})
    result = CliRunner().invoke(app, ["batch", str(folder), "-o", str(tmp_path / "out")])
    assert result.exit_code == 1
    assert "c.blend" in result.stderr
    assert "export them as .glb" in " ".join(result.stderr.split())


def test_strict_fails_for_one_failure(shelf: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def run(left, order, *, jobs):
        yield left[0], Outcome(reason="NOT_TODAY")

    monkeypatch.setattr(batch_engines, "local", run)
    roam_batch(shelf, "-o", tmp_path / "out")
    roam_batch(shelf, "-o", tmp_path / "out", "--strict", exit_code=1)


def test_a_file_that_cannot_be_read_fails_alone(tmp_path: Path):
    sources = [*files(tmp_path, {"a.obj": b"good"}), tmp_path / "gone.obj"]
    outcomes = {source.name: outcome for source, outcome in local(sources, ORDER, jobs=1, work=work)}
    assert outcomes["gone.obj"].reason == "NOT_READ"
    assert "gone.obj" in outcomes["gone.obj"].message
    assert outcomes["a.obj"].done


def test_poses_inside_the_folder_are_no_furniture(shelf: Path):
    files(shelf, {"poses/chair.pose.glb": b"x"})
    found = command.furniture_files(shelf, shelf / "poses")
    assert [path.name for path in found] == ["broken.glb", "chair.glb", "flat.stl"]


@pytest.mark.parametrize("folder", ["nowhere", "."])
def test_a_folder_without_furniture_is_a_usage_error(tmp_path: Path, folder: str):
    result = CliRunner().invoke(app, ["batch", str(tmp_path / folder), "-o", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert "error:" in result.stderr


@pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="needs Ray: pip install roam-services[ray]")
def test_ray_gives_what_the_local_engine_gives(shelf: Path, tmp_path: Path):
    """In a process of its own: Ray leaves threads and sockets behind, and warnings are errors here."""
    program = f"""
import sys
from pathlib import Path
sys.path.insert(0, {str(Path(__file__).parent)!r})
from roam_command.commands.batch.engines import local, ray_cluster
from test_batch import ORDER
if __name__ == "__main__":
    sources = [Path({str(shelf)!r}) / name for name in ("chairs/broken.glb", "flat.stl")]
    engine = dict(local=local, ray=ray_cluster)[sys.argv[1]]
    for source, outcome in sorted(engine(sources, ORDER, jobs=1)):
        print(source.name, outcome.reason, outcome.message)
"""
    script = tmp_path / "engine.py"
    script.write_text(program)
    said = []
    for engine in ("local", "ray"):
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        done = subprocess.run(
            [sys.executable, str(script), engine],
            capture_output=True,
            text=True,
            timeout=240,
            env=environment,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        said.append(done.stdout)
    assert "broken.glb OBJECT_MALFORMED" in said[0]
    assert said[0] == said[1]


def test_without_ray_the_command_says_what_to_install(shelf: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    result = CliRunner().invoke(app, ["batch", str(shelf), "-o", str(tmp_path / "out"), "--engine", "ray"])
    assert result.exit_code == 2
    assert "roam-services[ray]" in " ".join(result.stderr.split())
