"""Limbs and furniture: a box that a hand or a shin would be in."""

import numpy as np
import torch
from furnished import box
from roam_motion.animation.collision import furniture_of, goal_depths, keep_clear, limbs_of, near
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animator import CharacterState
from roam_motion.control.intent import Goal, Idle
from roam_motion.control.seat import goal_arrays
from standing import played, random_animator, seated_pose

FIGURE = humanoid_figure()


def seated():
    positions, orientations = goal_arrays(FIGURE, seated_pose())
    return torch.tensor(positions)[None], torch.tensor(orientations)[None]


def free(count=1):
    limbs = limbs_of(FIGURE)
    samples = 2 * len(limbs.arm_radii) + 2 * len(limbs.shin_radii) + len(limbs.trunk)
    return [np.zeros(samples, np.float32)] * count


def test_distances_are_those_of_the_box():
    volume = box([-0.3, 0.0, -0.3], [0.3, 0.4, 0.3])
    points = torch.tensor([[[0.0, 0.5, 0.0], [0.5, 0.2, 0.0], [0.0, 0.35, 0.0]]])
    distance, slope = furniture_of([volume], free(), [False]).distance(points)
    torch.testing.assert_close(distance, torch.tensor([[0.1, 0.2, -0.05]]), atol=0.005, rtol=0)
    torch.testing.assert_close(slope[0, :2], torch.tensor([[0.0, 1, 0], [1, 0, 0]]), atol=0.05, rtol=0)


def test_a_turned_volume_is_turned():
    volume = box([0.0, 0.0, 1.0], [0.2, 0.4, 1.4], yaw=np.pi / 2)
    # nodes are placed from the origin on: turned a quarter, the grid's z axis runs along the world's x
    corner = volume.origin + np.array([0.12 + 0.2, 0.12 + 0.2, -0.12 - 0.1])
    distance, _ = furniture_of([volume], free(), [False]).distance(
        torch.tensor(corner, dtype=torch.float32)[None, None]
    )
    assert float(distance) < -0.05
    assert near(FIGURE, volume, float(corner[0]), float(corner[2]))
    assert not near(FIGURE, volume, float(corner[0]) + 3, float(corner[2]))


def test_a_hand_in_the_furniture_comes_out_and_bones_keep_their_lengths():
    joints, orientations = seated()
    wrist = joints[0, FIGURE.skeleton.index("leftHand")].numpy()
    volume = box(
        wrist - np.array([0.10, 0.2, 0.2]), wrist + np.array([0.02, 0.2, 0.2])
    )  # from the inside to just beyond the wrist
    furniture = furniture_of([volume], free(), [False])
    depth = 0.037 - float(furniture.distance(torch.tensor(wrist)[None, None])[0])
    cleared, after = orientations, joints
    for _ in range(3):  # frames: no hand is pushed faster than hands move
        before = after
        _, cleared, _ = keep_clear(FIGURE, furniture, joints, cleared, torch.zeros(1))
        after = FIGURE.positions(joints[:, 0], cleared)
        assert float((after - before).norm(dim=-1).max()) < 0.065
    left = 0.037 - float(furniture.distance(after[:, [FIGURE.skeleton.index("leftHand")]])[0])
    assert depth > 0.05
    assert left < 0.015
    right = FIGURE.skeleton.indices(["rightLowerArm", "rightHand"])
    torch.testing.assert_close(after[:, right], joints[:, right], atol=1e-5, rtol=0)
    torch.testing.assert_close(cleared @ cleared.mT, torch.eye(3).expand_as(cleared), atol=1e-4, rtol=0)


def test_what_the_goal_pose_presses_is_allowed_and_settling_ends_the_push():
    joints, orientations = seated()
    wrist = joints[0, FIGURE.skeleton.index("leftHand")].numpy()
    volume = box(wrist - np.array([0.10, 0.2, 0.2]), wrist + np.array([0.02, 0.2, 0.2]))
    own = goal_depths(FIGURE, joints[0].numpy(), orientations[0].numpy(), volume)
    assert own.max() > 0.04
    for furniture, settled in (
        (furniture_of([volume], [own], [False]), 0.0),
        (furniture_of([volume], free(), [False]), 1.0),
    ):
        wanted, cleared, pushed = keep_clear(FIGURE, furniture, joints, orientations, torch.tensor([settled]))
        torch.testing.assert_close(cleared, orientations, atol=2e-3, rtol=0)
        torch.testing.assert_close(wanted, joints, atol=5e-3, rtol=0)
        assert not pushed.any()


def test_a_back_in_the_back_rest_leans_forward():
    joints, orientations = seated()
    chest = joints[0, FIGURE.skeleton.index("upperChest")].numpy()
    rest = box(chest - np.array([0.3, 0.3, 0.4]), chest + np.array([0.3, 0.3, -0.06]))  # its front 6 cm behind the axis
    furniture = furniture_of([rest], free(), [False])
    _, cleared, _ = keep_clear(FIGURE, furniture, joints, orientations, torch.zeros(1))
    after = FIGURE.positions(joints[:, 0], cleared)
    moved = (after - joints)[0]
    assert 0.025 < float(moved[FIGURE.skeleton.index("upperChest"), 2]) < 0.09
    legs = FIGURE.skeleton.indices(["leftUpperLeg", "rightLowerLeg", "leftFoot"])
    torch.testing.assert_close(moved[legs], torch.zeros(3, 3), atol=1e-5, rtol=0)


def test_a_foot_under_the_furniture_comes_forward_and_is_not_held():
    joints, orientations = seated()
    ankle = joints[0, FIGURE.skeleton.index("leftFoot")].numpy()
    volume = box(ankle - np.array([0.2, 0.05, 0.5]), ankle + np.array([0.2, 0.3, 0.01]))
    wanted, _, pushed = keep_clear(
        FIGURE, furniture_of([volume], free(), [False]), joints, orientations, torch.zeros(1)
    )
    assert float((wanted - joints)[0, FIGURE.skeleton.index("leftFoot"), 2]) > 0.025
    assert bool(pushed[0, 0])


def test_feet_go_onto_what_one_lies_down_on():
    joints, orientations = seated()
    ankle = joints[0, FIGURE.skeleton.index("leftFoot")].numpy()
    volume = box(ankle - np.array([0.2, 0.05, 0.5]), ankle + np.array([0.2, 0.3, 0.01]))
    furniture = furniture_of([volume], free(), [True])
    wanted, _, pushed = keep_clear(FIGURE, furniture, joints, orientations, torch.zeros(1))
    torch.testing.assert_close(wanted, joints)
    assert not pushed.any()


def test_a_session_remembers_the_furniture_while_it_gets_up_and_in_storage():
    animator = random_animator()
    volume = box([-0.25, 0.0, 1.2], [0.25, 0.4, 1.7])
    goal = Goal(seated_pose(ahead=1.5), volume=volume)
    states, _ = played(animator, [animator.start((0, 1.9), 0.0, 1)] * 2, [goal, Idle()], frames=3)
    again = CharacterState.from_bytes(states[0].to_bytes())
    np.testing.assert_array_equal(again.control.seat.volume.values, volume.values)
    assert states[1].control.seat is None
    for intent in (goal, Idle()):
        first, _ = played(animator, [states[0]], [intent], frames=5)
        second, _ = played(animator, [again, states[1]], [intent, Idle()], frames=5)
        assert first[0].to_bytes() == second[0].to_bytes()
