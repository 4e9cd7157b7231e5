import numpy as np
import pytest
import torch
from roam_character.rotation import quat_to_matrix
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animation.living import alive
from standing import seated_pose

FIGURE = humanoid_figure()
NAMES = FIGURE.skeleton.joint_names


def minute(share=1.0):
    """Joint positions [1800, J, 3] of a minute's sitting."""
    pose = seated_pose()
    orientations = FIGURE.world(quat_to_matrix(torch.tensor(pose.rotations))).expand(1800, -1, -1, -1)
    clock = torch.arange(1800) / 30
    moved = alive(FIGURE, orientations, torch.full((1800,), share), clock)
    return FIGURE.positions(torch.tensor(pose.root_position).expand(1800, 3), moved).numpy()


def test_a_held_pose_lives_and_stays_within_a_centimetre():
    positions = minute()
    away = np.linalg.norm(positions - seated_pose().positions(), axis=-1)
    assert 0.001 < away.mean() < 0.006
    assert away.mean(-1).max() < 0.01
    assert np.ptp(positions[:, NAMES.index("head")], axis=0).max() > 0.01
    assert np.linalg.norm(np.diff(positions, axis=0), axis=-1).max() < 0.003


def test_feet_and_hips_do_not_move_and_hands_hardly():
    positions = minute()
    lower = [i for i, name in enumerate(NAMES) if "Leg" in name or "Foot" in name or "Toes" in name or name == "hips"]
    np.testing.assert_array_equal(np.ptp(positions[:, lower], axis=0), 0)
    hands = [NAMES.index("leftHand"), NAMES.index("rightHand")]
    assert np.ptp(positions[:, hands], axis=0).max() < 0.035


def test_nothing_of_it_shows_on_the_way():
    np.testing.assert_allclose(minute(share=0.0), np.broadcast_to(seated_pose().positions(), (1800, 22, 3)), atol=1e-6)


def test_rotations_stay_rotations():
    orientations = torch.eye(3).expand(2, 22, 3, 3)
    moved = alive(FIGURE, orientations, torch.ones(2), torch.tensor([0.0, 1234.5]))
    assert torch.linalg.det(moved).numpy() == pytest.approx(1.0, abs=1e-5)
    torch.testing.assert_close(moved @ moved.transpose(-1, -2), orientations.contiguous(), atol=1e-5, rtol=0)
