"""NPZ files hold the arrays that other tools rely on."""

import numpy as np
import pytest
from roam_character.formats.npz import read_motion, read_pose, write_npz
from roam_character.skeleton import load_skeleton


def test_pose_file(clip, tmp_path):
    pose = clip.pose(3)
    write_npz(tmp_path / "pose.npz", pose, object_to_world=np.eye(4))
    arrays = np.load(tmp_path / "pose.npz", allow_pickle=False)
    assert set(arrays) == {
        "joint_names",
        "parents",
        "root_position",
        "rotations",
        "joint_positions",
        "object_to_world",
    }
    assert np.allclose(arrays["joint_positions"], pose.positions())
    assert np.allclose(read_pose(tmp_path / "pose.npz", clip.skeleton).rotations, pose.rotations)


def test_motion_file(clip, tmp_path):
    write_npz(tmp_path / "motion.npz", clip, contacts=np.ones((24, 4), bool), action=np.ones(24, np.int32))
    arrays = np.load(tmp_path / "motion.npz", allow_pickle=False)
    assert arrays["joint_positions"].shape == (24, 22, 3)
    assert float(arrays["fps"]) == 24.0
    assert np.allclose(read_motion(tmp_path / "motion.npz", clip.skeleton).rotations, clip.rotations)


def test_other_skeleton_is_refused(clip, tmp_path):
    write_npz(tmp_path / "pose.npz", clip.pose(0))
    with pytest.raises(ValueError, match="another skeleton"):
        read_pose(tmp_path / "pose.npz", load_skeleton("paper"))
