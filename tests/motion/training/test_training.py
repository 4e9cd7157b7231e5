import json

import numpy as np
import pytest
import torch
from roam_character.clip import Clip
from roam_character.documents.bvh import write_bvh
from roam_character.pose import rest_pose
from roam_character.rotation import quat_slerp
from roam_character.skeleton import humanoid_skeleton
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animator import Animator
from roam_motion.models.lnsm.features import encode_targets
from roam_motion.training import motion, publish
from roam_motion.training.data import labels
from roam_motion.training.data.dataset import build
from roam_motion.training.data.episodes import locomotion
from roam_motion.training.data.goals import Key, ankles, sitting_goal
from roam_motion.training.data.library import LibraryConfig, load_library
from roam_motion.training.data.recordings import Recording, Span, read_folder
from roam_motion.training.learning.expert import returning
from standing import seated_pose

FIGURE = humanoid_figure()


def sitting_clip(rate=24.0):
    """Stands 3 s, sits down in 1 s, sits 2 s, stands up in 1 s, stands 3 s."""
    share = np.concatenate([np.zeros(72), np.linspace(0, 1, 24), np.ones(48), np.linspace(1, 0, 24), np.zeros(72)])
    share = (share * share * (3 - 2 * share)).astype(np.float32)[:, None]
    stand, sit = rest_pose(humanoid_skeleton()), seated_pose(ahead=-0.35)
    rotations = quat_slerp(
        np.broadcast_to(stand.rotations, (240, 22, 4)), np.broadcast_to(sit.rotations, (240, 22, 4)), share[..., None]
    )
    roots = stand.root_position * (1 - share) + sit.root_position * share
    return Clip(humanoid_skeleton(), rate, roots.astype(np.float32), rotations.astype(np.float32))


@pytest.fixture
def folder(tmp_path):
    """A folder of BVH without any table, one file of it useless."""
    (tmp_path / "bvh").mkdir()
    for number in range(2):
        write_bvh(tmp_path / "bvh" / f"{number}.bvh", sitting_clip())
    (tmp_path / "bvh" / "broken.bvh").write_text("HIERARCHY nothing")
    return tmp_path / "bvh"


def test_a_sit_is_found_without_tables_and_bad_files_are_named(folder):
    recordings, rejects = read_folder(folder, humanoid_skeleton())
    assert [r.path.name for r in rejects] == ["broken.bvh"]
    span = recordings[0].spans[0]
    assert span.action == "sit"
    assert 60 <= span.down <= 96 <= span.first + 12
    assert 130 <= span.last <= 150
    assert 150 <= span.up <= 180


def test_contacts_have_hysteresis_and_phase_advances():
    clip = sitting_clip(30.0)
    contacts = labels.find_contacts(clip.positions(), 30.0, humanoid_skeleton().indices(labels.CONTACT_JOINTS))
    assert contacts[:60].all()
    phase = labels.find_phase(contacts, 30.0)
    assert (np.diff(phase) > 0).all()
    assert np.diff(phase).max() * 30 < 2.0
    soft = labels.soft_actions(["walk"] * 30 + ["sit-down"] * 30, 30.0)
    np.testing.assert_allclose(soft.sum(1), 1, atol=1e-5)
    assert 0.3 < soft[30, 2] < 0.7


def recording():
    clip = sitting_clip().resampled(30.0)
    spans = tuple(Span(*span) for span in labels.find_spans(clip))
    return Recording("made/up", clip, None, None, spans)


def test_sitting_goals_vary_and_keep_their_feet_on_the_floor():
    rng = np.random.default_rng(0)
    bank = [Key(p.root_position, p.rotations) for p in (seated_pose(), seated_pose(0.5))]
    goals = [sitting_goal(humanoid_skeleton(), bank, rng) for _ in range(12)]
    heights = [float(g.hips[1]) for g in goals]
    assert max(heights) - min(heights) > 0.1
    assert np.abs(np.stack([ankles(humanoid_skeleton(), g)[:, 1] for g in goals]) - 0.08).max() < 0.03


def test_the_expert_asks_for_the_data_when_on_the_track_and_returns_to_it_when_off():
    made = recording()
    dataset = build(FIGURE, locomotion(made, humanoid_skeleton()), [1.0] * 2)
    at = torch.tensor([20])
    truth, ahead = dataset.characters(FIGURE, at), dataset.targets(FIGURE, at)
    positions = FIGURE.positions(truth.hips, truth.orientations)
    exact = returning(FIGURE, truth, positions, truth, ahead)
    torch.testing.assert_close(exact.positions, ahead.positions, atol=1e-4, rtol=0)
    torch.testing.assert_close(exact.orientations, ahead.orientations, atol=1e-3, rtol=0)
    off = dataset.characters(FIGURE, at)
    off.hips = off.hips + torch.tensor([[0.3, 0.0, 0.0]])
    moved = FIGURE.positions(off.hips, off.orientations)
    back = returning(FIGURE, off, moved, truth, ahead)
    assert 0.0 < float((moved[:, 0] - back.positions[:, 0])[0, 0]) < 0.05
    goals, root = dataset.goals(at), FIGURE.frame(moved)
    assert torch.isfinite(encode_targets(FIGURE, off, goals, moved, root, back)).all()


def test_training_runs_stops_and_resumes(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("roam_motion.training.learning.validation._CHARACTERS", 2)
    monkeypatch.setattr("roam_motion.training.learning.validation._FRAMES", 4)
    common = ["--bvh", str(folder), "--out", str(tmp_path / "run"), "--cache", str(tmp_path / "cache")]
    small = ["--batch", "8", "--rollouts", "8", "--hidden", "16", "--encoding", "16", "--experts", "2"]
    assert motion.main([*common, *small, "--minutes", "0.02", "--export", str(tmp_path / "w.safetensors")]) == 0
    first = torch.load(tmp_path / "run" / "latest.pt", weights_only=True)["updates"]
    assert first > 0
    assert (tmp_path / "w.safetensors").exists()
    assert json.loads((tmp_path / "run" / "config.json").read_text())["batch"] == 8
    assert motion.main([*common, *small, "--minutes", "0.04", "--resume"]) == 0
    assert torch.load(tmp_path / "run" / "latest.pt", weights_only=True)["updates"] > first
    assert "resuming" in capsys.readouterr().out
    assert motion.main(["--bvh", str(tmp_path / "nowhere")]) == 2


def test_the_library_is_cached(folder, tmp_path):
    config = LibraryConfig(folders=(str(folder),), goals_per_sit=2)
    first, _, report = load_library(FIGURE, config, tmp_path / "cache")
    again, _, _ = load_library(FIGURE, config, tmp_path / "cache")
    torch.testing.assert_close(first.hips, again.hips)
    assert report["rejects"][0]["file"] == "broken.bvh"


def test_training_judges_checkpoints_on_approaches_too(folder, tmp_path, monkeypatch):
    monkeypatch.setattr("roam_motion.training.learning.validation._CHARACTERS", 2)
    monkeypatch.setattr("roam_motion.training.learning.validation._FRAMES", 4)
    monkeypatch.setattr("roam_motion.training.learning.approaches._FRAMES", 12)
    monkeypatch.setattr("roam_motion.training.learning.approaches._LEAVING", 8)
    small = ["--batch", "8", "--rollouts", "8", "--hidden", "16", "--encoding", "16", "--experts", "2"]
    common = ["--bvh", str(folder), "--out", str(tmp_path / "run"), "--cache", str(tmp_path / "cache")]
    assert motion.main([*common, *small, "--minutes", "0.01"]) == 0
    scores = json.loads((tmp_path / "run" / "validation.jsonl").read_text().splitlines()[-1])
    assert scores["reached"] == 0.0
    rolled = sum(scores[name] for name in ("root", "pose", "goal")) + 0.2 * scores["slide"]
    assert scores["score"] == pytest.approx(rolled + scores["people"])
    assert scores["people"] >= 0.3


def test_twisted_and_displaced_feet_are_asked_to_step_the_worse_one_first():
    dataset = build(FIGURE, locomotion(recording(), humanoid_skeleton()), [1.0] * 2)
    at = torch.tensor([20, 20, 20])
    truth, ahead = dataset.characters(FIGURE, at), dataset.targets(FIGURE, at)
    assert bool((ahead.contacts > 0.5).all())
    drifted = dataset.characters(FIGURE, at)
    turn = torch.tensor([[[0.77, 0, 0.64], [0, 1, 0], [-0.64, 0, 0.77]]])  # 40 degrees about the vertical
    left = humanoid_skeleton().indices(["leftFoot", "leftToes"])
    drifted.orientations = drifted.orientations.clone()
    drifted.orientations[1][left] = turn @ drifted.orientations[1][left]
    positions = FIGURE.positions(drifted.hips, drifted.orientations)
    right = FIGURE.contacts[2:]
    positions[2][right] += torch.tensor([-0.2, 0.0, 0.0])  # as far to the side as legs that were crossed
    asked = returning(FIGURE, drifted, positions, truth, ahead, dataset.goals(at))
    assert (asked.contacts > 0.5).tolist() == [[True] * 4, [False, False, True, True], [True, True, False, False]]
    lifted = asked.positions[2, right[0]] - ahead.positions[2, right[0]]
    assert 0.03 < float(lifted[1]) < 0.06
    assert -0.2 < float(lifted[0]) < -0.1  # on its way back


@pytest.mark.parametrize(("folders_name", "file"), [("clips", "motion"), ("hdm05_clips", "motion-cc-by-sa")])
def test_weights_are_published_in_a_file_of_their_licence(folder, folders_name, file, tmp_path, monkeypatch):
    monkeypatch.setattr("roam_motion.training.learning.validation._CHARACTERS", 2)
    monkeypatch.setattr("roam_motion.training.learning.validation._FRAMES", 4)
    monkeypatch.setattr("roam_motion.training.learning.approaches._FRAMES", 12)
    monkeypatch.setattr("roam_motion.training.learning.approaches._LEAVING", 8)
    clips = folder.rename(tmp_path / folders_name)
    run, cache, weights = tmp_path / "run", ["--cache", str(tmp_path / "cache")], tmp_path / "weights"
    small = ["--batch", "8", "--rollouts", "8", "--hidden", "16", "--encoding", "16", "--experts", "2"]
    asked = ["--share-alike"] if file != "motion" else []
    assert motion.main(["--bvh", str(clips), "--out", str(run), *cache, *small, *asked, "--minutes", "0.01"]) == 0
    assert publish.main([str(run / "best.pt"), "--weights", str(weights), *cache]) == 0
    assert [path.name for path in weights.glob("*.safetensors")] == [f"{file}.safetensors"]
    entry = json.loads((weights / "manifest.json").read_text())[f"{file}.safetensors"]
    assert entry["licence"] == ("CC-BY-SA-3.0" if asked else "Apache-2.0")
    assert entry["data"]["folders"] == [folders_name]
    assert entry["data"]["rejects"] == 1
    assert sum(entry["data"]["train"]["shares_percent"].values()) == pytest.approx(100, abs=1)
    assert Animator.load(weights / f"{file}.safetensors").figure is FIGURE
