"""What scripts rely on: streams, exit codes, JSON, files."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fake_services import FRAMES_TO_GOAL, Fake
from roam_command.main import app
from typer.testing import CliRunner, Result

runner = CliRunner()


def roam(*arguments: object) -> Result:
    return runner.invoke(app, [str(argument) for argument in arguments])


def test_pose_prints_the_numbers_that_matter(fake: Fake, chair: Path):
    result = roam("pose", chair, "--server", fake.address, "--reference", "chair_sit", "--seed", 4)
    assert result.exit_code == 0, result.output
    assert "hips to seat  3.0 cm" in result.stdout
    assert "penetration   1.0 cm" in result.stdout
    assert "taken for cm give unit" in result.stderr
    assert "taken for cm" not in result.stdout
    assert fake.goal_poses.requests[-1].seed == 4
    assert fake.goal_poses.requests[-1].reference_pose == "referencePoses/chair_sit"


def test_pose_writes_every_file_it_is_asked_for(fake: Fake, chair: Path, tmp_path: Path):
    files = [tmp_path / f"pose{ending}" for ending in (".npz", ".json", ".glb")]
    options = [text for path in files for text in ("-o", path)]
    result = roam("pose", chair, "--server", fake.address, "--json", *options)
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["files"] == [str(path) for path in files]
    assert answer["hip_seat_distance"] == pytest.approx(0.03)
    assert answer["energies"]["total"] == 0.5
    with np.load(files[0]) as saved:
        assert saved["object_to_world"].shape == (4, 4)
    assert files[2].read_bytes()[:4] == b"glTF"
    assert b'"object"' in files[2].read_bytes()


def test_pose_passes_wishes_on_and_writes_every_alternative(fake: Fake, chair: Path, tmp_path: Path):
    wishes = ["--seat", "0.1,0.4,-0.2", "--facing", 90, "--left-hand=-0.3,0.7,0", "--weight", "prior=0", "--count", 2]
    out = tmp_path / "pose.npz"
    result = roam("pose", chair, "--server", fake.address, "--json", "-o", out, "--height", 1.69, *wishes)
    assert result.exit_code == 0, result.output
    request = fake.goal_poses.requests[-1]
    assert list(request.constraints.seat_point) == [0.1, 0.4, -0.2]
    assert request.constraints.facing == pytest.approx(np.pi / 2)
    assert request.constraints.hand_targets[0].position[0] == -0.3
    assert (dict(request.weights), request.count) == ({"prior": 0.0}, 2)
    assert request.skeleton.joint_names[0] == "hips"
    answer = json.loads(result.stdout)
    assert answer["files"] == [str(out), str(tmp_path / "pose-2.npz")]
    assert len(answer["alternatives"]) == 1
    assert answer["quality"]["contacts_met"] == 0.75


def test_pose_adapts_a_pose_of_ones_own(fake: Fake, chair: Path, tmp_path: Path):
    saved = tmp_path / "mine.npz"
    assert roam("pose", chair, "--server", fake.address, "-o", saved).exit_code == 0
    result = roam("pose", chair, "--server", fake.address, "--like", saved, "--like-object", chair)
    assert result.exit_code == 0, result.output
    assert fake.goal_poses.created[-1].title == "mine"
    assert fake.goal_poses.requests[-1].reference_pose == "referencePoses/sha256:own"


@pytest.mark.parametrize("wish", [["--seat", "1,2"], ["--weight", "prior"], ["--like", __file__], ["--seat", "a,b,c"]])
def test_pose_refuses_wishes_that_cannot_be_read(fake: Fake, chair: Path, wish: list[str]):
    assert roam("pose", chair, "--server", fake.address, *wish).exit_code == 2
    assert fake.goal_poses.requests == []


def test_sit_walks_from_three_metres_in_front_and_saves(fake: Fake, chair: Path, tmp_path: Path):
    files = [tmp_path / f"sit{ending}" for ending in (".npz", ".glb", ".bvh")]
    options = [text for path in files for text in ("-o", path)]
    result = roam("sit", chair, "--server", f"goalpose={fake.address},motion={fake.address}", "--json", *options)
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["reached"]
    assert answer["frames"] == FRAMES_TO_GOAL + 30
    assert answer["final_position_error"] == pytest.approx(0, abs=1e-6)
    created = fake.motions.created[-1]
    assert (created.start_placement.x, created.start_placement.z) == (pytest.approx(0), pytest.approx(3.1))
    assert abs(created.start_placement.yaw) == pytest.approx(np.pi)
    assert created.floor_height == pytest.approx(0.25)
    with np.load(files[0]) as saved:
        assert saved["root_position"].shape == (answer["frames"], 3)
    assert b"animations" in files[1].read_bytes()
    assert files[2].read_text().startswith("HIERARCHY")


def test_sit_takes_a_start_in_metres_and_degrees(fake: Fake, chair: Path):
    result = roam("sit", chair, "--server", fake.address, "--start", "-1,2,90", "--frames", 5, "--action", "lie")
    assert result.exit_code == 0, result.output
    place = fake.motions.created[-1].start_placement
    assert (place.x, place.z) == (-1, 2)
    assert place.yaw == pytest.approx(np.pi / 2)
    assert fake.goal_poses.requests[-1].action == 4
    assert "did not settle" in result.stderr
    assert "more --frames" in " ".join(result.stderr.split())
    assert "not reached" in result.stdout


def test_sit_stands_up_again_when_asked(fake: Fake, chair: Path):
    result = roam("sit", chair, "--server", fake.address, "--json", "--hold", 0.2, "--stand-up")
    answer = json.loads(result.stdout)
    assert answer["frames"] > FRAMES_TO_GOAL + 6
    assert answer["final_position_error"] == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["pose", "nowhere.obj", "--server", "SERVER"], 2, "there is no file nowhere.obj"),
        (["pose", "README", "--server", "SERVER"], 2, "give one of obj, glb"),
        (["pose", "CHAIR", "--server", "SERVER", "-o", "pose.doc"], 2, "Use one of .npz, .json, .glb"),
        (["pose", "CHAIR", "--server", "SERVER", "-o", "no/such/pose.npz"], 2, "there is no folder"),
        (["pose", "CHAIR", "--server", "localhost"], 2, "host:port"),
        (["pose", "CHAIR", "--server", "goalpose=a:1"], 2, "motion=host:port"),
        (["sit", "CHAIR", "--server", "SERVER", "--start", "here"], 2, "--start 0,3,180"),
        (["sit", "CHAIR", "--server", "SERVER", "--start", "nan,0,0"], 2, "is not a place"),
        (["pose", "CHAIR", "--server", "127.0.0.1:1"], 3, "roam serve"),
        (["pose", "BAD", "--server", "SERVER"], 4, "export the mesh again"),
        (["pose", "CHAIR", "--server", "SERVER", "--reference", "nobody"], 4, "no reference pose nobody"),
        (["pose", "CHAIR", "--server", "SERVER", "--solver", "busy"], 1, "the queue is full"),
        (["pose"], 2, "Missing argument"),
    ],
)
def test_errors_are_sentences_with_an_exit_code(fake: Fake, chair: Path, arguments: list[str], code: int, words: str):
    bad = chair.parent / "bad.obj"
    bad.write_text("bad")
    readme = chair.parent / "README"
    readme.write_text("x")
    names = {"SERVER": fake.address, "CHAIR": str(chair), "BAD": str(bad), "README": str(readme)}
    result = roam(*(names.get(argument, argument) for argument in arguments))
    assert result.exit_code == code, result.output
    assert words in " ".join(result.stderr.split())
    assert result.stdout == ""


def test_errors_are_json_for_machines(fake: Fake, chair: Path):
    result = roam("pose", chair, "--server", fake.address, "--reference", "nobody", "--json")
    assert result.exit_code == 4
    assert json.loads(result.stdout)["error"]["reason"] == "REFERENCE_POSE_NOT_FOUND"


def test_help_is_quick_and_loads_nothing_heavy():
    code = (
        "import sys; from roam_command.main import app; "
        "print(*[n for n in ('torch', 'scipy', 'trimesh', 'fastapi', 'uvicorn') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.split() == []


@pytest.mark.parametrize("command", [[], ["pose"], ["sit"], ["demo"], ["serve"], ["train"], ["evaluate"]])
def test_every_command_explains_itself(command: list[str]):
    result = roam(*command, "--help")
    assert result.exit_code == 0
    assert "Usage" in result.stdout
