"""Captured clips and the product's frames come as they should, and pictures are drawn of them."""

import numpy as np
import pytest
from PIL import Image
from roam_character.clip import Clip
from roam_character.documents.bvh import write_bvh
from roam_character.pose import rest_pose
from roam_character.skeleton import humanoid_skeleton
from roam_evaluation.motion.people import evaluate, performed, pictures
from roam_evaluation.motion.people.activities import ACTIVITIES
from roam_evaluation.motion.people.captured import cached_captured, fingerprint, read_captured
from roam_evaluation.motion.people.evaluate import SHIPPED, main
from roam_evaluation.motion.people.reference import people_samples
from roam_evaluation.motion.people.storage import write_motions
from roam_motion.animator import Animator, Idle, Steer
from walkers import walker


@pytest.fixture
def mocap(tmp_path):
    """A folder of two clips at 24 Hz: one held out, one that sits."""
    root = tmp_path / "mocap"
    folder = root / "cmu_footlock"
    folder.mkdir(parents=True)
    (root / "HELDOUT.txt").write_text("# not for training\n09_\n")
    pose = rest_pose(humanoid_skeleton())
    for name in ("09_01.bvh", "13_02.bvh"):
        clip = Clip(
            pose.skeleton, 24.0, np.repeat(pose.root_position[None], 48, 0), np.repeat(pose.rotations[None], 48, 0)
        )
        write_bvh(folder / name, clip)
    (root / "SEGMENTS.csv").write_text("file,start,end,label,seconds\ncmu/13_02.bvh,0,23,walk,1\n")
    (root / "CATALOG.csv").write_text("file,sit_phases,lie_phases\ncmu/13_02.bvh,4>12-36>44,\n")
    return root


def test_clips_are_split_and_labelled_at_the_new_rate(mocap):
    found = read_captured(mocap, folders=("cmu_footlock",))
    assert [m.name for m in found.held_out] == ["cmu_footlock/09_01"]
    (kept,) = found.training
    assert kept.person == "13"
    assert len(kept) == pytest.approx(60, abs=1)  # two seconds at 30 Hz
    labels = {s.label: (s.first, s.last) for s in kept.stretches}
    assert labels == {"walk": (0, 29), "sit held": (15, 45)}
    assert [m.name for m in read_captured(mocap, only_held_out=True).all] == ["cmu_footlock/09_01"]


def test_what_is_remembered_of_clips_is_what_was_read_and_changes_with_them(mocap, tmp_path):
    before = fingerprint(mocap)
    first, again = (cached_captured(mocap, tmp_path / "cache") for _ in range(2))
    assert [m.name for m in first.all] == [m.name for m in again.all]
    assert np.abs(first.all[0].positions - read_captured(mocap).all[0].positions).max() < 1e-6
    (idle,) = [a for a in ACTIVITIES if a.key == "idle"]
    made = people_samples(idle, first, mocap, tmp_path / "cache")
    assert people_samples(idle, first, mocap, tmp_path / "cache") == made
    (mocap / "HELDOUT.txt").write_text("13_\n")
    assert fingerprint(mocap) != before


def test_a_folder_without_a_list_of_held_out_clips_is_refused_with_advice(tmp_path):
    with pytest.raises(FileNotFoundError, match="HELDOUT"):
        read_captured(tmp_path)


def test_scenes_tell_what_they_say_when_they_say_it():
    (scene,) = performed.steered((0.9,), [1])
    begin, end = performed.GOING.start, performed.GOING.stop
    assert isinstance(scene.script(begin - 1), Idle)
    told = scene.script(begin)
    assert isinstance(told, Steer)
    assert np.linalg.norm(told.velocity) == pytest.approx(0.9)
    assert isinstance(scene.script(end), Idle)
    left, right = performed.on_the_spot((90,), [1, 2])
    assert left.script(100).facing[0] == pytest.approx(1.0)  # +X is to the left
    assert right.script(100).facing[0] == pytest.approx(-1.0)


def test_the_product_performs_scenes_of_different_lengths_in_one_batch():
    animator = Animator.load(SHIPPED)
    short, long = performed.standing([1], seconds=0.5), performed.standing([2], seconds=1.0)
    made = performed.perform(animator, [*short, *long])
    assert [len(m) for m in made] == [15, 30]
    (alone,) = performed.perform(animator, short)
    assert np.array_equal(alone.positions, made[0].positions)
    assert made[1].told == "idle"


def test_a_filmstrip_and_a_video_show_a_body_and_stay_small(tmp_path):
    scene = pictures.Scene("walk", walker(seconds=1.0))
    pictures.strip(scene, tmp_path / "walk.png")
    pictures.film(scene, tmp_path / "walk.webp")
    sheet = np.asarray(Image.open(tmp_path / "walk.png").convert("RGB")).astype(int)
    orange = (sheet[..., 0] > 130) & (sheet[..., 2] < 100)
    green = (sheet[..., 1] > 90) & (sheet[..., 0] < 120) & (sheet[..., 2] < 100)
    assert orange.mean() > 0.01
    assert green.mean() > 0.005
    with Image.open(tmp_path / "walk.webp") as film:
        assert film.n_frames >= 14
    assert (tmp_path / "walk.webp").stat().st_size < 400_000


def test_kept_frames_are_measured_again_and_reported(mocap, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(evaluate, "_CACHE", tmp_path / "cache")
    kept = tmp_path / "frames.npz"
    motion = walker()
    write_motions(kept, [type(motion)("steer 0.9 m/s, seed 1", "1", motion.positions, (), "steer 0.9")])
    report = tmp_path / "report.json"
    options = ["--people", "--mocap", str(mocap), "--recorded", str(kept), "--json", str(report), "--no-blind"]
    assert main([*options, "--only", "walk_0.9"]) == 0
    shown = capsys.readouterr().out
    assert "knee bend when the foot strikes" in shown
    assert "no people to compare with" in shown  # the fixture's clips only stand
    assert '"measure": "step_width"' in report.read_text()


def test_what_cannot_be_measured_is_refused_with_advice(mocap, tmp_path, capsys):
    assert main(["--people", "--mocap", str(tmp_path / "nowhere")]) == 2
    assert "--mocap" in capsys.readouterr().err
    assert main(["--people", "--mocap", str(mocap), "--only", "walk_0.9,hop"]) == 2
    assert "hop; it knows walk_0.9" in capsys.readouterr().err
