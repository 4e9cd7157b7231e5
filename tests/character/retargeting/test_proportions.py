"""The T-pose and the lengths of a character, whatever pose it is bound in."""

import numpy as np
import pytest
from rig_maker import BASE, named
from roam_character.retargeting.proportions import rest_positions

POSES = {
    "T": {}, "A": {"arms_down": 50}, "elbows bent": {"arms_down": 40, "elbows_bent": 45}, "leaning": {"lean": 40},
    "facing -Z": {"yaw": 180}, "facing +X": {"yaw": 90}, "plain joints": {"turned_joints": False},
    "armature scale": {"node_scale": 100.0}, "stride": {"stride": 50}, "no skin": {"skinned": False},
}  # fmt: skip


@pytest.mark.parametrize("pose", POSES)
def test_the_same_body_in_any_bind_pose(fitted, pose):
    found = fitted(names=named("unreal"), **POSES[pose])
    here, there = rest_positions(found.skeleton), rest_positions(BASE)
    # soles: the toes' box reaches 2 cm below their joint, which the humanoid's sole does too within 6 mm
    here, there = here - here[0], there - there[0]
    limbs = [BASE.index(b) for b in BASE.joint_names if "Foot" not in b and "Toes" not in b]
    # a leaning trunk is put straight up, without the slant that people's shoulders have behind their hips
    np.testing.assert_allclose(here[limbs], there[limbs], atol=0.002 if pose != "leaning" else 0.05)
    assert found.scale == 1.0


@pytest.mark.parametrize("size", [0.7, 1.0, 1.2])
def test_sizes_that_people_have_are_kept(fitted, size):
    found = fitted(names=named("unreal"), size=size)
    assert found.scale == 1.0
    assert found.height == pytest.approx(1.69 * size, abs=0.08)


@pytest.mark.parametrize("size", [0.01, 2.9, 100.0])
def test_other_sizes_are_shown_as_an_adult_and_said(fitted, size):
    found = fitted(names=named("unreal"), size=size)
    assert found.height == pytest.approx(1.70, abs=0.08)
    assert "--height" in found.notes[-1]
    assert found.scale * size == pytest.approx(fitted(names=named("unreal"), height=1.7).scale, rel=0.02)


def test_a_height_that_is_asked_for(fitted):
    assert fitted(names=named("unreal"), height=1.2).height == pytest.approx(1.2, abs=0.06)


def test_long_legs_stay_long(fitted):
    found = fitted(names=named("mixamo"), proportions={"leftLowerLeg": 1.3, "rightLowerLeg": 1.3})
    lengths = np.linalg.norm(found.skeleton.rest_offsets, axis=-1)
    assert lengths[BASE.index("leftLowerLeg")] == pytest.approx(0.4 * 1.3, abs=1e-3)
    assert lengths[BASE.index("leftUpperArm")] == pytest.approx(np.hypot(0.125, 0.015), abs=1e-3)


def test_lacking_bones_stand_where_turning_them_moves_nothing(fitted):
    lacking = ("chest", "upperChest", "neck", "leftShoulder", "rightShoulder", "leftToes", "rightToes")
    found = fitted(names=named("unreal"), without=lacking)
    lengths = np.linalg.norm(found.skeleton.rest_offsets, axis=-1)
    for bone in ("chest", "upperChest"):
        assert lengths[BASE.index(bone)] < 2e-3
    for bone in ("leftUpperArm", "head"):
        assert lengths[BASE.index(bone)] < 2e-3
    assert found.carriers[found.bones["spine"]] == BASE.index("upperChest")


def test_the_skeleton_is_one_that_goal_poses_take(fitted):
    found = fitted(names=named("smpl"), arms_down=30)
    assert found.skeleton.humanoid_bones == BASE.humanoid_bones
    assert np.allclose(found.skeleton.rest_rotations, [0, 0, 0, 1])
    assert found.skeleton.rest_offsets[0, 1] > 0.9
