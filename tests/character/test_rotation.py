"""Rotations agree with scipy in numpy and in torch, and are differentiable where it matters."""

import numpy as np
import pytest
import torch
from roam_character import rotation
from scipy.spatial.transform import Rotation

Q = Rotation.random(64, random_state=0).as_quat()
P = Rotation.random(64, random_state=1).as_quat()
V = np.random.default_rng(2).normal(size=(64, 3))

KINDS = pytest.mark.parametrize("kind", [np.asarray, torch.as_tensor], ids=["numpy", "torch"])


def same_turn(a, b) -> bool:
    a, b = np.asarray(a), np.asarray(b)
    return np.allclose(np.abs(np.sum(a * b, axis=-1)), 1, atol=1e-9)


@KINDS
def test_product_and_rotation_agree_with_scipy(kind):
    assert same_turn(rotation.quat_mul(kind(Q), kind(P)), (Rotation.from_quat(Q) * Rotation.from_quat(P)).as_quat())
    assert np.allclose(rotation.quat_rotate(kind(Q), kind(V)), Rotation.from_quat(Q).apply(V))


@KINDS
def test_rotation_vectors_agree_with_scipy(kind):
    assert same_turn(rotation.quat_from_rotvec(kind(V)), Rotation.from_rotvec(V).as_quat())
    assert np.allclose(rotation.quat_to_rotvec(kind(Q)), Rotation.from_quat(Q).as_rotvec(), atol=1e-7)


@KINDS
def test_matrices_and_6d_round_trip(kind):
    assert np.allclose(rotation.quat_to_matrix(kind(Q)), Rotation.from_quat(Q).as_matrix())
    assert same_turn(rotation.quat_from_matrix(rotation.quat_to_matrix(kind(Q))), Q)
    assert same_turn(rotation.quat_from_6d(rotation.quat_to_6d(kind(Q))), Q)


def test_quaternion_of_matrix_is_right_at_half_turns():
    half_turns = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0.6, 0.8, 0, 0]])
    assert same_turn(rotation.quat_from_matrix(rotation.quat_to_matrix(half_turns)), half_turns)


@KINDS
def test_between_turns_one_direction_into_the_other(kind):
    u, v = kind(V), kind(np.roll(V, 1, axis=0))
    turned = rotation.quat_rotate(rotation.quat_between(u, v), rotation.vec_normalize(u))
    assert np.allclose(turned, rotation.vec_normalize(v))


def test_between_opposite_directions_is_a_half_turn():
    up = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])
    assert np.allclose(rotation.quat_rotate(rotation.quat_between(up, -up), up), -up)


def test_slerp_agrees_with_scipy_and_nlerp_ends_are_exact():
    from scipy.spatial.transform import Slerp

    pair = Rotation.from_quat(np.stack([Q[0], P[0]]))
    assert same_turn(rotation.quat_slerp(Q[0], P[0], 0.3), Slerp([0, 1], pair)(0.3).as_quat())
    assert same_turn(rotation.quat_nlerp(Q, P, 0.0), Q)
    assert same_turn(rotation.quat_nlerp(Q, P, 1.0), P)


def test_yaw_faces_sin_cos():
    yaw = np.linspace(-3, 3, 13)
    forward = rotation.quat_rotate(rotation.quat_from_yaw(yaw), np.broadcast_to([0.0, 0, 1], (13, 3)))
    assert np.allclose(forward, rotation.yaw_direction(yaw))
    assert np.allclose(rotation.quat_yaw(rotation.quat_from_yaw(yaw)), yaw)


def test_gradients_are_finite_at_the_identity():
    vector = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    turned = rotation.quat_rotate(rotation.quat_from_rotvec(vector), torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))
    turned[0].backward()
    assert torch.allclose(vector.grad, torch.tensor([0.0, 1.0, 0.0], dtype=torch.float64))
