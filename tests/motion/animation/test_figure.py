import numpy as np
import torch
from roam_character.kinematics import facing, forward_kinematics
from roam_character.matrices import matrix_from_6d, matrix_from_rotvec, matrix_to_6d
from roam_character.rotation import quat_from_rotvec, quat_to_matrix
from roam_motion.animation.figure import Frame, humanoid_figure


def random_pose(seed=0):
    rng = np.random.default_rng(seed)
    turns = quat_from_rotvec(rng.normal(size=(22, 3)).astype(np.float32) * 0.6)
    return np.array([0.3, 0.9, -1.2], np.float32), turns


def test_positions_agree_with_forward_kinematics():
    figure = humanoid_figure()
    hips, turns = random_pose()
    world = figure.world(quat_to_matrix(torch.tensor(turns)))
    expected = forward_kinematics(figure.skeleton, hips, turns).positions
    np.testing.assert_allclose(figure.positions(torch.tensor(hips), world), expected, atol=1e-5)
    torch.testing.assert_close(figure.world(figure.local(world)), world, atol=1e-5, rtol=0)


def test_facing_agrees_with_the_paper_rule():
    figure = humanoid_figure()
    positions = forward_kinematics(figure.skeleton, *random_pose(3)).positions
    yaw = float(facing(figure.skeleton, positions))
    np.testing.assert_allclose(figure.facing(torch.tensor(positions)), [np.sin(yaw), np.cos(yaw)], atol=1e-5)


def test_frames_go_in_and_out():
    frame = Frame(torch.tensor([[1.0, -2.0]]), torch.tensor([[0.6, 0.8]]))
    points = torch.randn(1, 7, 3, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(frame.points_out(frame.points_in(points)), points)
    torch.testing.assert_close(frame.points_in(points)[..., [0, 2]], frame.points_in(points[..., [0, 2]]))
    ahead = torch.tensor([[[1.0 + 0.6, 0.0, -2.0 + 0.8]]])
    torch.testing.assert_close(frame.points_in(ahead), torch.tensor([[[0.0, 0.0, 1.0]]]))


def test_a_frame_facing_x_has_its_left_at_minus_z():
    frame = Frame(torch.zeros(1, 2), torch.tensor([[1.0, 0.0]]))
    torch.testing.assert_close(frame.turn_in(torch.tensor([[[0.0, 0.0, -1.0]]])), torch.tensor([[[1.0, 0.0, 0.0]]]))


def test_axes_rebuild_the_rotation():
    rotation = quat_to_matrix(torch.tensor(random_pose(5)[1]))
    torch.testing.assert_close(matrix_from_6d(matrix_to_6d(rotation)), rotation, atol=1e-5, rtol=0)
    sheared = matrix_to_6d(rotation) + 0.1
    square = matrix_from_6d(sheared)
    torch.testing.assert_close(square @ square.transpose(-1, -2), torch.eye(3).expand_as(square), atol=1e-5, rtol=0)


def test_quick_rotations_agree_with_the_general_ones():
    generator = torch.Generator().manual_seed(2)
    vectors = torch.randn(50, 22, 3, generator=generator) * 2
    vectors[0], vectors[1] = 0.0, vectors[1] * 1e-5
    matrices = quat_to_matrix(quat_from_rotvec(vectors))
    torch.testing.assert_close(matrix_from_rotvec(vectors), matrices, atol=2e-6, rtol=0)
