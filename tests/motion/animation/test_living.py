"""Still bodies live: breath, shifts and looks, and neither feet, hips nor resting hands leave where they are."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from roam_character.pose import Pose
from roam_character.rotation import quat_from_rotvec, quat_to_matrix
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animation.living import WIDTH, Life, alive, gazed
from roam_motion.animation.manner import NAMES as MANNERS
from roam_motion.animation.state import Characters, characters_width
from standing import seated_pose

FIGURE = humanoid_figure()
NAMES = FIGURE.skeleton.joint_names
HANDS = [NAMES.index("leftHand"), NAMES.index("rightHand")]
FRAMES = 1800


def bent_pose():
    """The seated pose with bent elbows."""
    pose = seated_pose()
    rotations = pose.rotations.copy()
    for side, turn in (("left", -1.2), ("right", 1.2)):
        rotations[NAMES.index(f"{side}LowerArm")] = quat_from_rotvec(np.array([0, turn, 0], np.float32))
    return Pose(pose.skeleton, pose.root_position, rotations)


POSE = bent_pose()


def sitting(settled=1.0, frames=FRAMES):
    """Characters that hold a seated pose, and the pose's orientations."""
    pose = POSE
    characters = Characters.of(torch.zeros(frames, characters_width(len(NAMES))))
    orientations = FIGURE.world(quat_to_matrix(torch.tensor(pose.rotations))).expand(frames, -1, -1, -1).contiguous()
    hips = torch.tensor(pose.root_position).expand(frames, 3)
    return replace(characters, hips=hips, settled=torch.full((frames,), settled)), orientations


def minute(settled=1.0, hands=1.0, back=1.0, manner=None):
    """Joint positions [1800, J, 3] of a minute's sitting."""
    characters, orientations = sitting(settled)
    if manner is not None:
        characters.manner = torch.tensor(manner).expand(FRAMES, -1)
    life = torch.zeros(FRAMES, WIDTH)
    life[:, 0] = 1234 + torch.arange(FRAMES) / 30
    life[:, 1:4] = torch.tensor([hands, hands, back])
    moved = alive(FIGURE, characters, orientations, Life.of(life))
    return FIGURE.positions(characters.hips, moved).numpy()


@pytest.mark.parametrize("rests", [1.0, 0.0])
def test_a_held_pose_lives_and_stays_within_a_centimetre_or_so(rests):
    positions = minute(hands=rests, back=rests)
    away = np.linalg.norm(positions - POSE.positions(), axis=-1).mean(-1)
    assert 0.002 < away.mean() < 0.011
    assert away.max() < 0.02
    assert np.ptp(positions[:, NAMES.index("head")], axis=0).max() > 0.02
    assert np.linalg.norm(np.diff(positions, axis=0), axis=-1).max() < 0.006


def test_feet_and_hips_do_not_move_and_hands_that_rest_on_furniture_stay():
    positions = minute()
    lower = [i for i, name in enumerate(NAMES) if "Leg" in name or "Foot" in name or "Toes" in name or name == "hips"]
    np.testing.assert_array_equal(np.ptp(positions[:, lower], axis=0), 0)
    assert np.ptp(positions[:, HANDS], axis=0).max() < 0.004
    assert np.ptp(minute(hands=0.0)[:, HANDS], axis=0).max() > 0.02


def test_nobody_leans_into_the_back_rest():
    positions = minute()
    back = positions[:, NAMES.index("upperChest"), 2] - POSE.positions()[NAMES.index("upperChest"), 2]
    assert back.min() > -0.008
    assert back.max() > 0.01


def test_nothing_of_it_shows_on_the_way():
    np.testing.assert_allclose(minute(settled=0.0), np.broadcast_to(POSE.positions(), (FRAMES, 22, 3)), atol=1e-5)


def test_restless_people_shift_more():
    sizes = []
    for deviate in (-1.6, 1.6):
        manner = [0.0] * len(MANNERS)
        manner[MANNERS.index("unrest")] = deviate
        sizes.append(np.ptp(minute(manner=manner)[:, NAMES.index("head")], axis=0).max())
    assert sizes[1] > 1.3 * sizes[0]


def test_the_head_turns_to_what_is_looked_at_and_back():
    characters, orientations = sitting(frames=1)
    positions = FIGURE.positions(characters.hips, orientations)
    life = torch.zeros(1, WIDTH)
    life[0, 4:7], life[0, 7] = torch.tensor([2.0, 1.2, 1.5]), 1
    turned = []
    for frame in range(90):
        characters.gaze = gazed(FIGURE, characters, positions, Life.of(life))
        turned.append(float(characters.gaze[0, 0]))
        if frame == 45:
            life[0, 7] = 0
    assert turned[45] == pytest.approx(np.arctan2(2.0, 1.5), abs=0.08)  # to its left
    assert np.abs(np.diff(turned)).max() < 0.095
    assert abs(turned[-1]) < 0.03
    characters.gaze = torch.tensor([[0.9, 0.0, 1.0]])
    head = NAMES.index("head")
    moved = alive(FIGURE, characters, orientations, Life.of(torch.zeros(1, WIDTH)))
    ahead = moved[0, head, :, 2] @ orientations[0, head, :, 2]
    assert float(ahead) == pytest.approx(np.cos(0.9), abs=0.1)


def test_rotations_stay_rotations():
    characters, orientations = sitting(frames=2)
    moved = alive(
        FIGURE,
        characters,
        orientations,
        Life.of(torch.randn(2, WIDTH, generator=torch.Generator().manual_seed(0)).abs()),
    )
    assert torch.linalg.det(moved).numpy() == pytest.approx(1.0, abs=1e-5)
    torch.testing.assert_close(moved @ moved.mT, torch.eye(3).expand(2, 22, 3, 3).contiguous(), atol=1e-5, rtol=0)
