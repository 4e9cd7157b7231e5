"""Arms of those who walk swing farther, and nobody else's."""

import torch
from roam_motion.animation.manner import NAMES
from roam_motion.animation.state import Characters
from roam_motion.animation.swing import swinging, walking
from standing import random_animator

MEAN = torch.zeros(1, len(NAMES))


def hanging(ahead=0.5):
    """A standing body whose left arm hangs this far in front [rad], and its joints."""
    animator = random_animator()
    figure = animator.figure
    characters = Characters.of(torch.from_numpy(animator.start((0.4, 1.0), 0.8, 0).row)[None])
    sign = {"left": 1.0, "right": -1.0}
    for side in sign:
        for part in ("UpperArm", "LowerArm", "Hand"):
            joint = figure.skeleton.index(f"{side}{part}")
            down = torch.tensor([[0.0, sign[side], 0.0], [-sign[side], 0.0, 0.0], [0.0, 0.0, 1.0]])
            c, s = torch.tensor(ahead).cos(), torch.tensor(ahead).sin()
            forth = torch.tensor([[1.0, 0, 0], [0, c, s], [0, -s, c]])
            characters.orientations[:, joint] = characters.orientations[:, 0] @ forth @ down
    return figure, characters, figure.positions(characters.hips, characters.orientations)


def angles(figure, hips, orientations):
    """How far both hands are in front of their shoulders [rad]."""
    positions = figure.positions(hips, orientations)
    local = figure.frame(positions).points_in(positions)
    names = figure.skeleton
    reach = (
        local[:, names.indices(["leftHand", "rightHand"])] - local[:, names.indices(["leftUpperArm", "rightUpperArm"])]
    )
    return torch.atan2(reach[..., 2], -reach[..., 1])[0]


def swung(ahead):
    """Both hands' angles in front of their shoulders [rad] after arms that hung `ahead` swing."""
    figure, characters, positions = hanging(ahead)
    before = angles(figure, characters.hips, characters.orientations)
    torch.testing.assert_close(before, torch.full((2,), ahead), atol=0.02, rtol=0)
    orientations = swinging(figure, positions, characters.orientations, torch.ones(1), MEAN)
    return angles(figure, characters.hips, orientations)


def test_arms_swing_farther_than_the_network_moves_them():
    assert bool((swung(0.5) - swung(0.0) > 0.5 + 0.03).all())


def test_elbows_are_bent_and_upper_arms_hang_back_while_walking():
    figure, characters, positions = hanging(0.0)
    after = swinging(figure, positions, characters.orientations, torch.ones(1), MEAN)
    joints = figure.positions(characters.hips, after)
    local = figure.frame(joints).points_in(joints)[0]
    names = figure.skeleton
    shoulder, elbow, hand = (local[names.index(f"left{name}")] for name in ("UpperArm", "LowerArm", "Hand"))
    upper, fore = elbow - shoulder, hand - elbow
    bend = torch.rad2deg(torch.acos(torch.dot(upper, fore) / upper.norm() / fore.norm()))
    assert 15 < float(bend) < 35  # straight before
    assert float(upper[2]) < -0.02


def test_who_does_not_walk_is_left_alone():
    figure, characters, positions = hanging()
    same = swinging(figure, positions, characters.orientations, torch.zeros(1), MEAN)
    torch.testing.assert_close(same, characters.orientations)
    assert float(walking(characters)) == 0.0
    characters.past[:, -1, 4:8] = torch.tensor([0.0, 1.0, 0.0, 0.0])
    assert float(walking(characters)) == 0.0  # steps on the spot, as before a seat
    characters.future[:, -1, 1] += 0.9
    assert float(walking(characters)) == 1.0
    characters.blend[:] = 1.0
    assert float(walking(characters)) == 0.0


def test_people_differ_in_how_far_their_arms_swing():
    figure, characters, positions = hanging()
    swings = []
    for deviate in (-1.6, 0.0, 1.6):
        manner = MEAN.clone()
        manner[:, NAMES.index("arms")] = deviate
        turned = swinging(figure, positions, characters.orientations, torch.ones(1), manner)
        swings.append(float(angles(figure, characters.hips, turned).mean()))
    assert swings[1] - swings[0] > 0.05
    assert swings[2] - swings[1] > 0.05
