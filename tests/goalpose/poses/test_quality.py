"""How good a pose says it is."""

from dataclasses import replace

import numpy as np
import pytest
from roam_character.body import body_capsules
from roam_goalpose.assessment.quality import bone_penetrations, joint_limit_use, quality_of
from roam_goalpose.assessment.result import RankedPose
from roam_goalpose.synthesis import GoalPoseRequest
from solving import pair


def ranked(pose, **changes):
    values = {
        "pose": pose,
        "place": (0.0, 0.45, 0.0),
        "reference": "chair_sit",
        "action": "sit",
        "energies": {"descriptor": 0.35, "total": 0.35},
        "diagnostics": {"hip_seat_distance": 0.01, "contacts_met": 0.5},
        "bone_depths": {"hips": 0.02, "leftUpperLeg": 0.03},
        "warnings": (),
    }
    return RankedPose(**(values | changes))


def test_a_bone_in_the_middle_of_a_block_counts_whole():
    """The hips' capsule sunk into the solid sofa."""
    sofa = pair("sofa_sit")
    pose = sofa.pose
    capsules = body_capsules(pose.skeleton)
    hips = capsules.names.index("hips")
    low = sofa.shape.distance.sample(np.array([0.0, 0.25, 0.0], np.float32))
    assert low < -capsules.radii[hips]  # solid there
    sunk = pose.moved(np.array([0.0, 0.25, 0.0]) - pose.root_position)
    (found,) = bone_penetrations(sunk, {"hips": 0.2}, sofa.shape)
    length = np.linalg.norm(capsules.ends[hips] - capsules.starts[hips])
    radius = capsules.radii[hips]
    assert found.volume == pytest.approx(np.pi * radius**2 * (length + 4 / 3 * radius), rel=0.05)


def test_bones_are_told_deepest_first_and_sum_up():
    quality = quality_of(ranked(pair("chair_sit").pose), pair("chair_sit").shape, descriptor_weight=0.7)
    assert [bone.bone for bone in quality.penetrations] == ["leftUpperLeg", "hips"]
    assert quality.penetration_depth == 0.03
    assert quality.penetration_volume == sum(bone.volume for bone in quality.penetrations)
    assert quality.floor_distance is None


def test_the_residual_is_the_term_without_its_weight():
    shape, pose = pair("chair_sit").shape, pair("chair_sit").pose

    def residual(one, **request):
        weight = GoalPoseRequest(**request).weight_of("descriptor")
        return quality_of(one, shape, descriptor_weight=weight).descriptor_residual

    assert residual(ranked(pose), weights=(("descriptor", 0.7),)) == pytest.approx(0.5)
    assert residual(ranked(pose), solver="paper") == pytest.approx(0.35)
    assert residual(ranked(pose, energies={"total": 0.0})) is None


def test_a_knee_that_bends_forwards_is_beyond_its_limit():
    pose = pair("bed_lie").pose
    rotations = pose.rotations.copy()
    rotations[pose.skeleton.index("leftLowerLeg")] = [np.sin(-0.6), 0, 0, np.cos(-0.6)]
    assert joint_limit_use(pose) < 1.0
    assert joint_limit_use(replace(pose, rotations=rotations)) > 1.2
