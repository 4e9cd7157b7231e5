"""Motion of a foreign skeleton lands on the humanoid with its feet where they were."""

import numpy as np
import pytest
from roam_character.clip import Clip
from roam_character.documents.bvh import read_bvh
from roam_character.retarget import RetargetError, retarget
from roam_character.skeleton import Skeleton, humanoid_skeleton, load_skeleton


def test_same_skeleton_is_left_alone(clip):
    assert retarget(clip, humanoid_skeleton()) is clip


def test_there_and_back_keeps_the_joints(clip):
    paper = retarget(clip, load_skeleton("paper"))
    back = retarget(paper, humanoid_skeleton())
    gap = np.linalg.norm(back.positions() - clip.positions(), axis=-1)
    assert gap[:, clip.skeleton.indices(["leftFoot", "rightFoot"])].max() < 0.04
    # A straight leg 1 cm too short pushes its knee out by 10 cm: only the ankles can be held to more.
    assert gap[:, clip.skeleton.indices(["leftLowerLeg", "rightLowerLeg"])].max() < 0.12


def test_unknown_joint_names_are_refused_with_what_to_do(clip):
    strange = Skeleton(
        tuple(f"bone{i}" for i in range(22)),
        clip.skeleton.parents,
        clip.skeleton.rest_offsets,
        clip.skeleton.rest_rotations,
    )
    with pytest.raises(RetargetError, match="rename them"):
        retarget(Clip(strange, 24.0, clip.root_positions, clip.rotations), humanoid_skeleton())


def test_motion_capture_keeps_its_ankles(mocap):
    source = read_bvh(mocap / "cmu_footlock" / "86_15.bvh").cut(0, 400)
    skeleton = humanoid_skeleton()
    clip = retarget(source, skeleton)
    feet = skeleton.indices(["leftFoot", "rightFoot"])
    theirs = source.skeleton.indices(["lFoot", "rFoot"])
    gap = np.linalg.norm(clip.positions()[:, feet] - source.positions()[:, theirs], axis=-1)
    assert gap.max() < 0.01
    assert clip.positions()[:, skeleton.indices(["leftToes", "rightToes"]), 1].min() > 0.02


@pytest.mark.parametrize("missing", ["leftLowerLeg"])
def test_message_names_the_missing_bone(clip, missing):
    names = tuple("thing" if n == missing else n for n in clip.skeleton.joint_names)
    other = Skeleton(names, clip.skeleton.parents, clip.skeleton.rest_offsets, clip.skeleton.rest_rotations)
    with pytest.raises(RetargetError, match=missing):
        retarget(Clip(other, 24.0, clip.root_positions, clip.rotations), humanoid_skeleton())
