"""Reference pairs for people of other sizes."""

from dataclasses import replace

import numpy as np
import pytest
from roam_character.skeleton import Tip, humanoid_skeleton
from roam_goalpose.assessment.quality import bone_penetrations
from roam_goalpose.references.bodies import check_bones, fitted
from roam_goalpose.references.model import height_above_surface
from solving import pair
from torch import as_tensor


def person(scale):
    """The default skeleton, `scale` times as large."""
    skeleton = humanoid_skeleton()
    tips = tuple(Tip(t.name, t.parent, tuple(scale * x for x in t.offset)) for t in skeleton.tips)
    return replace(skeleton, rest_offsets=np.float32(scale) * skeleton.rest_offsets, tips=tips)


def test_the_same_person_sits_the_same():
    assert fitted(pair("chair_sit"), humanoid_skeleton()) is pair("chair_sit")


@pytest.mark.parametrize("scale", [0.8, 1.15])
def test_hips_are_as_high_over_the_seat_as_the_body_is_large(scale):
    before, after = pair("chair_sit"), fitted(pair("chair_sit"), person(scale))

    def height(one):
        return height_above_surface(one.shape.distance, as_tensor(one.pose.root_position))

    assert height(after) == pytest.approx(scale * height(before), abs=0.01)
    assert after.pose.skeleton == person(scale)
    assert np.degrees(abs(after.pose.yaw())) < 2


@pytest.mark.parametrize("scale", [1.05, 1.15])
def test_feet_stay_on_the_floor_where_legs_reach_it(scale):
    after = fitted(pair("stool_sit"), person(scale)).pose
    ankle = after.skeleton.index("leftFoot")
    standing = person(scale).rest_offsets[0, 1] + sum(
        person(scale).rest_offsets[after.skeleton.index(f"left{bone}"), 1] for bone in ("UpperLeg", "LowerLeg", "Foot")
    )
    assert after.positions()[ankle, 1] == pytest.approx(standing, abs=0.02)


def test_short_legs_hang_from_the_seat():
    after = fitted(pair("stool_sit"), person(0.85)).pose
    knee, ankle = (after.positions()[after.skeleton.index(f"left{bone}")] for bone in ("LowerLeg", "Foot"))
    shank = ankle - knee
    assert ankle[1] > 0.10  # standing on the floor it would be at 0.07
    assert -shank[1] > 0.97 * np.linalg.norm(shank)


@pytest.mark.parametrize("scale", [0.85, 1.15])
def test_nobody_sinks_into_their_seat(scale):
    after = fitted(pair("chair_sit"), person(scale))
    depths = {"hips": 0.01, "leftUpperLeg": 0.01, "chest": 0.01}  # volumes are measured anew
    assert sum(bone.volume for bone in bone_penetrations(after.pose, depths, after.shape)) < 0.004


def test_lacking_bones_are_named():
    skeleton = humanoid_skeleton()
    bones = tuple("" if bone == "leftHand" else bone for bone in skeleton.humanoid_bones)
    with pytest.raises(ValueError, match="leftHand"):
        check_bones(replace(skeleton, humanoid_bones=bones))


@pytest.mark.parametrize("scale", [0.0, 1e-3, 10.0, 100.0, 300.0, 1e6])
def test_a_skeleton_in_another_unit_is_refused_and_the_unit_named(scale):
    skeleton = humanoid_skeleton()
    offsets = (skeleton.rest_offsets * scale).astype(np.float32)
    with pytest.raises(ValueError, match="metres"):
        check_bones(replace(skeleton, rest_offsets=offsets, tips=()))


@pytest.mark.parametrize("scale", [0.3, 1.0, 2.5])
def test_small_and_large_bodies_are_taken(scale):
    skeleton = humanoid_skeleton()
    check_bones(replace(skeleton, rest_offsets=(skeleton.rest_offsets * scale).astype(np.float32), tips=()))


def test_a_limb_without_length_and_a_tip_far_away_are_refused():
    skeleton = humanoid_skeleton()
    offsets = skeleton.rest_offsets.copy()
    offsets[skeleton.index("leftFoot")] = 0.0
    with pytest.raises(ValueError, match="no length"):
        check_bones(replace(skeleton, rest_offsets=offsets))
    far = replace(skeleton.tips[0], offset=(0.0, 40.0, 0.0))
    with pytest.raises(ValueError, match="40 m"):
        check_bones(replace(skeleton, tips=(far,)))
