"""Skeletons are data: the shipped ones load, and wrong ones are refused with a reason."""

import numpy as np
import pytest
from roam_character.skeleton import Skeleton, humanoid_skeleton, load_skeleton


def test_humanoid_has_the_vrm_bones_from_hips_to_toes():
    skeleton = humanoid_skeleton()
    assert skeleton.joint_count == 22
    assert skeleton.joint_names == skeleton.humanoid_bones
    assert skeleton.dof == 69


def test_paper_skeleton_has_75_degrees_of_freedom():
    skeleton = load_skeleton("paper")
    assert skeleton.joint_count == 24
    assert skeleton.dof == 75
    assert len(skeleton.tips) == 3  # 27 points with the end points


@pytest.mark.parametrize("name", ["humanoid", "paper"])
def test_mirror_pairs_are_symmetric_in_the_rest_pose(name):
    skeleton = load_skeleton(name)
    mirror = list(skeleton.mirror)
    assert [mirror[m] for m in mirror] == list(range(skeleton.joint_count))
    flipped = skeleton.rest_offsets[mirror] * np.array([-1, 1, 1])
    assert np.allclose(flipped, skeleton.rest_offsets, atol=1e-6)


def test_id_depends_on_the_content_only():
    skeleton = humanoid_skeleton()
    longer = Skeleton(skeleton.joint_names, skeleton.parents, skeleton.rest_offsets * 1.01, skeleton.rest_rotations)
    assert skeleton.id.startswith("sha256:")
    assert longer.id != skeleton.id
    assert longer != skeleton


def test_children_before_parents_are_refused():
    with pytest.raises(ValueError, match="parent must precede"):
        Skeleton(("a", "b"), (-1, 1), np.zeros((2, 3)), np.zeros((2, 4)))


def test_unknown_skeleton_names_the_known_ones():
    with pytest.raises(FileNotFoundError, match="humanoid, paper"):
        load_skeleton("centaur")


def test_unknown_joint_lists_the_joints():
    with pytest.raises(KeyError, match="hips"):
        humanoid_skeleton().index("tail")
