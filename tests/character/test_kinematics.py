"""Forward kinematics agrees with a chain of 4x4 matrices; limbs reach their targets and keep their bones."""

import numpy as np
import pytest
import torch
from roam_character import kinematics, rotation
from roam_character.pose import rest_pose
from roam_character.skeleton import humanoid_skeleton, load_skeleton
from scipy.spatial.transform import Rotation


def random_posture(skeleton, seed, count=4):
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(rng.normal(scale=0.5, size=(count * skeleton.joint_count, 3))).as_quat()
    return rng.normal(size=(count, 3)), turns.reshape(count, skeleton.joint_count, 4)


def matrix_chain(skeleton, root, turns):
    """The oracle: one homogeneous matrix per joint, multiplied from root to leaf."""
    world = []
    for joint, parent in enumerate(skeleton.parents):
        local = np.eye(4)
        local[:3, :3] = Rotation.from_quat(turns[joint]).as_matrix()
        local[:3, 3] = root if parent < 0 else skeleton.rest_offsets[joint]
        world.append(local if parent < 0 else world[parent] @ local)
    return np.stack(world)


@pytest.mark.parametrize("name", ["humanoid", "paper"])
def test_forward_kinematics_agrees_with_matrices_in_numpy_and_torch(name):
    skeleton = load_skeleton(name)
    roots, turns = random_posture(skeleton, 0)
    expected = np.stack([matrix_chain(skeleton, r, t) for r, t in zip(roots, turns, strict=True)])
    posture = kinematics.forward_kinematics(skeleton, roots, turns)
    assert np.allclose(posture.positions, expected[..., :3, 3], atol=1e-6)
    assert np.allclose(rotation.quat_to_matrix(posture.orientations), expected[..., :3, :3], atol=1e-6)
    tensors = kinematics.forward_kinematics(skeleton, torch.as_tensor(roots), torch.as_tensor(turns))
    assert np.allclose(tensors.positions.numpy(), posture.positions)


def test_local_rotations_invert_the_orientations():
    skeleton = humanoid_skeleton()
    roots, turns = random_posture(skeleton, 1)
    posture = kinematics.forward_kinematics(skeleton, roots, turns)
    back = kinematics.local_rotations(skeleton, posture.orientations)
    assert np.allclose(np.abs(np.sum(back * turns, axis=-1)), 1)


def test_kinematics_is_differentiable():
    skeleton = humanoid_skeleton()
    vectors = torch.zeros(skeleton.joint_count, 3, dtype=torch.float64, requires_grad=True)

    def hand_height(v):
        q = rotation.quat_from_rotvec(v)
        return kinematics.forward_kinematics(skeleton, torch.zeros(3, dtype=torch.float64), q).positions[9, 1]

    assert torch.autograd.gradcheck(hand_height, vectors + 0.1)


@pytest.mark.parametrize("name", ["leftLeg", "rightLeg", "leftArm", "rightArm"])
def test_limb_reaches_its_target_and_keeps_the_end_orientation(name):
    skeleton = humanoid_skeleton()
    which = kinematics.limb(skeleton, name)
    roots, turns = random_posture(skeleton, 2, count=16)
    posture = kinematics.forward_kinematics(skeleton, roots, turns)
    start = posture.positions[:, which.upper]
    away = np.random.default_rng(3).normal(size=start.shape)
    target = start + 0.4 * away / np.linalg.norm(away, axis=-1, keepdims=True)
    turns[:, list(which)] = kinematics.reach_with_limb(skeleton, which, posture, target)
    reached = kinematics.forward_kinematics(skeleton, roots, turns)
    assert np.allclose(reached.positions[:, which.end], target, atol=2e-3)
    angle = rotation.quat_angle(reached.orientations[:, which.end], posture.orientations[:, which.end])
    assert np.max(angle) < 1e-3


def test_limb_out_of_reach_points_at_the_target():
    skeleton = humanoid_skeleton()
    which = kinematics.limb(skeleton, "leftLeg")
    pose = rest_pose(skeleton)
    target = pose.positions()[which.upper] + np.array([0.0, 0.0, 3.0])
    turns = pose.rotations.copy()
    turns[list(which)] = kinematics.reach_with_limb(skeleton, which, pose.posture(), target)
    leg = kinematics.forward_kinematics(skeleton, pose.root_position, turns).positions[list(which)]
    assert np.allclose(leg[2] - leg[0], [0, 0, 0.82], atol=0.01)


def test_straight_knee_bends_forward():
    skeleton = humanoid_skeleton()
    which = kinematics.limb(skeleton, "rightLeg")
    pose = rest_pose(skeleton)
    target = pose.positions()[which.end] + np.array([0.0, 0.2, 0.0])
    turns = pose.rotations.copy()
    turns[list(which)] = kinematics.reach_with_limb(skeleton, which, pose.posture(), target)
    leg = kinematics.forward_kinematics(skeleton, pose.root_position, turns).positions[list(which)]
    assert leg[1, 2] > 0.1


def test_facing_is_the_yaw_of_hips_and_shoulders():
    pose = rest_pose(humanoid_skeleton())
    for yaw in (-2.5, -1.0, 0.0, 0.4, 3.0):
        assert pose.turned(yaw).yaw() == pytest.approx(yaw, abs=1e-5)


def test_a_posture_has_the_same_bits_alone_and_in_a_batch():
    skeleton = humanoid_skeleton()
    roots, turns = (torch.as_tensor(part).float() for part in random_posture(skeleton, 3, count=9))
    together = kinematics.forward_kinematics(skeleton, roots, turns)
    for k in range(len(roots)):
        alone = kinematics.forward_kinematics(skeleton, roots[k : k + 1], turns[k : k + 1])
        assert torch.equal(alone.positions[0], together.positions[k])
        assert torch.equal(alone.orientations[0], together.orientations[k])


def test_what_was_first_computed_in_inference_mode_can_be_differentiated_later():
    skeleton = load_skeleton("paper")
    roots, turns = (torch.as_tensor(part) for part in random_posture(skeleton, 4, count=2))
    with torch.inference_mode():
        kinematics.forward_kinematics(skeleton, roots, turns)
    turns.requires_grad_()
    kinematics.forward_kinematics(skeleton, roots, turns).positions.sum().backward()
    assert torch.isfinite(turns.grad).all()


@pytest.mark.parametrize("kind", [np.asarray, torch.as_tensor])
def test_a_bent_joint_keeps_both_bones_and_points_to_its_side(kind):
    rng = np.random.default_rng(6)
    start, side = kind(rng.normal(size=(50, 3))), kind(rng.normal(size=(50, 3)))
    way = rng.normal(size=(50, 3))
    end = start + kind(way / np.linalg.norm(way, axis=-1, keepdims=True) * rng.uniform(0.1, 0.82, size=(50, 1)))
    upper, lower = kind(np.full((50, 1), 0.45)), kind(np.full((50, 1), 0.38))
    middle = np.asarray(kinematics.bent_joint(start, end, (upper, lower), side))
    assert np.allclose(np.linalg.norm(middle - np.asarray(start), axis=-1), 0.45, atol=1e-5)
    assert np.allclose(np.linalg.norm(middle - np.asarray(end), axis=-1), 0.38, atol=1e-5)
    along = np.asarray(end - start)
    off = (middle - np.asarray(start)) - (((middle - np.asarray(start)) * along).sum(-1) / (along * along).sum(-1))[
        :, None
    ] * along
    assert ((off * np.asarray(side)).sum(-1) > 0).all()


def test_a_joint_of_an_end_out_of_reach_is_nearly_straight():
    start, end = torch.zeros(1, 3), torch.tensor([[0.0, -2.0, 0.0]])
    lengths = torch.full((1, 1), 0.4), torch.full((1, 1), 0.4)
    middle = kinematics.bent_joint(start, end, lengths, torch.tensor([[0.0, 0.0, 1.0]]), straightest=0.998)
    assert 0 < float(middle[0, 2]) < 0.03
    assert float(middle[0].norm()) == pytest.approx(0.4, abs=1e-5)
