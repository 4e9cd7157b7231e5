"""What of a folder of clips is trained on, how often, and under which licence."""

import numpy as np
import pytest
import torch
from leaning import leaning_clip
from roam_character.clip import Clip
from roam_character.documents.bvh import write_bvh
from roam_character.skeleton import humanoid_skeleton
from roam_motion.actions import STYLES
from roam_motion.animation.figure import humanoid_figure
from roam_motion.training import motion
from roam_motion.training.data.balance import GOING, TAKING, balanced, kinds_of_going
from roam_motion.training.data.dataset import build
from roam_motion.training.data.episodes import locomotion
from roam_motion.training.data.library import LibraryConfig, held_out_names, is_held_out, load_library
from roam_motion.training.data.licences import APACHE, SHARE_ALIKE, LicenceError, licence_of, share_alike
from roam_motion.training.data.recordings import Recording, read_folder

FIGURE, SKELETON = humanoid_figure(), humanoid_skeleton()


def gliding(speeds, turns=None, rate=30.0):
    """A standing figure that is moved along its facing at given speeds [m/s], turning at given rates [rad/s]."""
    count = len(speeds)
    yaw = np.cumsum(np.zeros(count) if turns is None else turns) / rate
    steps = np.asarray(speeds)[:, None] / rate * np.stack([np.sin(yaw), np.cos(yaw)], 1)
    roots = np.stack([np.cumsum(steps[:, 0]), np.full(count, 0.955), np.cumsum(steps[:, 1])], 1).astype(np.float32)
    rotations = np.tile(leaning_clip().rotations[0], (count, 1, 1))
    rotations[:, 0] = np.stack([np.zeros(count), np.sin(yaw / 2), np.zeros(count), np.cos(yaw / 2)], 1)
    return Clip(SKELETON, rate, roots, rotations.astype(np.float32))


def kinds(clip, label="walk"):
    (episode,) = locomotion(Recording("made/up", clip, None, [label] * len(clip), ()), SKELETON)
    return [list(GOING)[k] for k in kinds_of_going(episode)], episode


@pytest.mark.parametrize("label", ["jog", "run", "sneak", "walk", "turn", "idle"])
def test_all_ways_of_going_about_are_locomotion(label):
    _, episode = kinds(gliding(np.full(40, 2.0)), label)
    assert len(episode.clip) == 40
    assert episode.styles[:, STYLES.index("idle" if label == "idle" else "walk")].min() > 0.99


def test_other_labels_are_not():
    clip = gliding(np.full(60, 0.0))
    assert locomotion(Recording("made/up", clip, None, ["stoop"] * 60, ()), SKELETON) == []


def test_clips_of_a_second_are_used_and_shorter_ones_named(tmp_path):
    for name, count in (("short", 20), ("enough", 34)):
        write_bvh(tmp_path / f"{name}.bvh", gliding(np.full(count, 1.0)))
    recordings, rejects = read_folder(tmp_path, SKELETON)
    assert [r.name.split("/")[1] for r in recordings] == ["enough"]
    assert "shorter than 1 second" in rejects[0].reason


def test_tables_of_another_folder_do_not_speak_of_this_one(tmp_path):
    """`cmu` is not the plain form of `cmu_loop`; it is of `cmu_footlock`."""
    (tmp_path / "SEGMENTS.csv").write_text("file,start,end,label,seconds\nwalks/one.bvh,0,39,run,1.6\n")
    for folder in ("walks_loop", "walks_footlock"):
        (tmp_path / folder).mkdir()
        write_bvh(tmp_path / folder / "one.bvh", gliding(np.full(40, 1.0)))
    assert read_folder(tmp_path / "walks_loop", SKELETON)[0][0].segments is None
    assert set(read_folder(tmp_path / "walks_footlock", SKELETON)[0][0].segments) == {"run"}


def test_kinds_of_going_are_told_by_speed_and_turning():
    steady = {"walk": 0.8, "brisk walk": 1.4, "run": 2.8, "idle": 0.0}
    for name, speed in steady.items():
        assert set(kinds(gliding(np.full(90, speed)))[0]) == {name}
    assert kinds(gliding(np.zeros(90), np.full(90, 1.2)))[0][45] == "turn on the spot"
    there = np.concatenate([np.zeros(60), np.full(60, 1.0), np.zeros(60)])
    found = kinds(gliding(there))[0]
    assert (found[55], found[90], found[125]) == ("start", "walk", "stop")
    turning = np.r_[np.zeros(45), np.full(45, 1.5)]
    assert kinds(gliding(np.zeros(90), turning))[0][38] == "turn on the spot"  # who is about to turn, too


def test_every_kind_gets_its_share_whatever_its_minutes():
    much, little = kinds(gliding(np.full(900, 0.8)))[1], kinds(gliding(np.full(60, 2.8)))[1]
    both = [kinds_of_going(e) for e in (much, little)]
    weights = balanced(both, GOING)
    assert sum(w.sum() for w in weights) == pytest.approx(1)
    assert weights[1].sum() / weights[0].sum() == pytest.approx(GOING["run"] / GOING["walk"])
    assert sum(GOING.values()) == pytest.approx(1)
    assert sum(TAKING.values()) == pytest.approx(1)


def test_a_path_goes_on_beyond_the_clip_as_it_ends():
    """A cut clip is not a stop: goals two seconds ahead lie where the walk would have led."""
    _, episode = kinds(gliding(np.full(90, 1.2)))
    dataset = build(FIGURE, [episode], [1.0])
    ahead = dataset.goals(torch.tensor([80])).positions[0]
    assert float(ahead[-1, 1] - ahead[0, 1]) == pytest.approx(2 * 1.2, abs=0.15)
    future = dataset.targets(FIGURE, torch.tensor([80])).trajectory[0]
    assert float(future[-1, 1] - future[0, 1]) == pytest.approx(1.2, abs=0.05)
    standing = build(FIGURE, [kinds(gliding(np.r_[np.full(60, 1.0), np.zeros(30)]))[1]], [1.0])
    ends = standing.goals(torch.tensor([85])).positions[0]
    assert float((ends[-1] - ends[0]).norm()) < 0.05


@pytest.fixture
def folder(tmp_path):
    clips = tmp_path / "clips"
    clips.mkdir()
    for name in ("walk_1", "walk_2", "secret_1"):
        write_bvh(clips / f"{name}.bvh", gliding(np.full(90, 1.0)))
    write_bvh(clips / "sit.bvh", leaning_clip())
    return clips


@pytest.mark.parametrize("where", ["clips", "."])
def test_clips_that_heldout_names_are_not_trained_on(folder, where):
    (folder.parent / where / "HELDOUT.txt").write_text("# not these\nsecret_  # nor any of its kind\n\n")
    config = LibraryConfig((str(folder),), goals_per_sit=2)
    assert "secret_" in held_out_names(config)
    _, validation, report = load_library(FIGURE, config, folder.parent / "cache")
    assert report["held_out"] == ["clips/secret_1"]
    assert report["licence"] == APACHE
    assert len(validation) == 90
    assert report["train"]["sit"] > 0
    assert sum(report["train"]["shares_percent"].values()) == pytest.approx(100, abs=1)
    assert report["train"]["shares_percent"]["sit: down"] > report["train"]["shares_percent"]["sit: leaving"]


def test_compositions_of_held_out_clips_are_held_out_too():
    assert is_held_out("derived_lie2/bd_lieDown_001_on_113_15_0", ("113_15",))
    assert is_held_out("derived_seat/113_15", ("113_15",))
    assert not is_held_out("cmu/86_15", ("15_0",))


@pytest.mark.parametrize("mark", ["name", "notice", "table"])
def test_share_alike_clips_are_refused_unless_asked_for(folder, mark, capsys):
    if mark == "name":
        folder = folder.rename(folder.parent / "hdm05_footlock")
    elif mark == "notice":
        (folder / "LICENCE.md").write_text("These clips are under CC BY-SA 3.0.")
    else:
        (folder / "CATALOG.csv").write_text('file,licence\nclips/walk_1.bvh,"CC BY-SA 3.0 (see LICENCE.md)"\n')
    assert share_alike(folder)
    with pytest.raises(LicenceError, match="--share-alike"):
        licence_of([str(folder)], allowed=False)
    assert licence_of([str(folder)], allowed=True) == SHARE_ALIKE
    assert motion.main(["--bvh", str(folder), "--out", str(folder.parent / "run")]) == 2
    assert "leave these folders out" in capsys.readouterr().out
    assert not (folder.parent / "run").exists()


def test_permissive_folders_are_taken(folder):
    (folder / "LICENSE.txt").write_text("MIT License. Permission is hereby granted, free of charge")
    assert licence_of([str(folder)], allowed=False) == APACHE
