"""Poses arrive on a character's own joints: hands and feet where they are, orientations as they are."""

import numpy as np
import pytest
from rig_maker import BASE, named
from roam_character.retargeting.onto_rig import back_from_rig, continuous, onto_rig
from roam_character.rotation import quat_angle, quat_from_rotvec

TRAPS = {
    "plain": {}, "A pose": {"arms_down": 50, "elbows_bent": 30}, "facing -Z": {"yaw": 180}, "stride": {"stride": 50},
    "4.9 m": {"size": 2.9}, "centimetres": {"size": 100.0}, "armature scale": {"node_scale": 0.01},
    "thighs below the spine": {"parents": {"leftUpperLeg": "spine", "rightUpperLeg": "spine"}},
    "feet below the root": {"parents": {"leftFoot": "", "rightFoot": ""}},
    "collars below the neck": {"parents": {"leftShoulder": "neck", "rightShoulder": "neck"}},
    "no skin": {"skinned": False},
    "few bones": {"without": ("upperChest", "neck", "leftShoulder", "rightShoulder", "leftToes", "rightToes")},
}  # fmt: skip


@pytest.mark.parametrize("trap", TRAPS)
def test_joints_are_where_the_pose_has_them(fitted, bending, trap):
    found = fitted(names=named("biped"), **TRAPS[trap])
    clip = bending(found.skeleton)
    motion = onto_rig(found, clip)
    places, wanted = motion.worlds()[..., :3, 3], clip.positions()
    for bone, joint in found.bones.items():
        if bone != "hips":
            gap = np.linalg.norm(places[:, joint] - wanted[:, BASE.index(bone)], axis=-1)
            assert gap.max() < 0.003, bone  # a lacking bone is a millimetre long


@pytest.mark.parametrize("trap", TRAPS)
def test_there_and_back(fitted, bending, trap):
    found = fitted(names=named("biped"), **TRAPS[trap])
    clip = bending(found.skeleton)
    back = back_from_rig(onto_rig(found, clip))
    here, there = (np.asarray(c.posture().orientations, float) for c in (back, clip))
    known = sorted(found.carriers.values())
    assert np.degrees(quat_angle(here[:, known], there[:, known])).max() < 0.2
    np.testing.assert_allclose(back.root_positions, clip.root_positions, atol=1e-3)


def test_the_t_pose_is_the_t_pose(fitted):
    from roam_character.pose import rest_pose

    found = fitted(names=named("unreal"), arms_down=45, yaw=90)
    motion = onto_rig(found, rest_pose(found.skeleton))
    left = motion.worlds()[0, found.bones["leftHand"], :3, 3] - motion.worlds()[0, found.bones["leftUpperArm"], :3, 3]
    assert left[0] == pytest.approx(np.linalg.norm(left), rel=1e-4)  # the left arm points along +X


def test_joints_above_the_hips_and_helpers_stay(fitted, bending):
    found = fitted(names=named("unreal"))
    motion = onto_rig(found, bending(found.skeleton))
    armature = found.rig.joint_names.index("Armature")
    assert not motion.driven[armature]
    np.testing.assert_allclose(motion.worlds()[:, armature], np.broadcast_to(np.eye(4), (15, 4, 4)), atol=1e-9)


def test_fingers_go_with_the_hand_as_they_are_bound(fitted, bending):
    found = fitted(names=named("unreal"), extras=[("index_01_l", "leftHand", (0.09, 0, 0.02))], stride=30)
    worlds = onto_rig(found, bending(found.skeleton)).worlds()
    finger, hand = found.rig.joint_names.index("index_01_l"), found.bones["leftHand"]
    local = np.linalg.inv(worlds[:, hand]) @ worlds[:, finger]
    bound = np.linalg.inv(found.rig.bind[hand]) @ found.rig.bind[finger]
    np.testing.assert_allclose(local, np.broadcast_to(bound, local.shape), atol=1e-5)


def test_a_twist_joint_takes_its_part_of_the_twist(fitted, bending):
    from roam_character.clip import Clip

    extras = [("lowerarm_twist_01_l", "leftLowerArm", (0.1225, 0, 0))]
    found = fitted(names=named("unreal"), extras=extras)
    turns = np.tile(BASE.rest_rotations.astype(float), (2, 1, 1))
    turns[1, BASE.index("leftHand")] = quat_from_rotvec(np.array([1.0, 0, 0]))  # one radian about the forearm
    clip = Clip(found.skeleton, 30.0, np.zeros((2, 3), np.float32), turns.astype(np.float32))
    rotations = onto_rig(found, clip).rotations[:, found.rig.joint_names.index("lowerarm_twist_01_l")]
    assert quat_angle(rotations[0], rotations[1]) == pytest.approx(0.5, abs=0.02)  # it is half way along


def test_spine_joints_between_ours_share_the_bend(fitted):
    from roam_character.clip import Clip

    extras = [("spine_015", "spine", (0, 0.06, 0))]
    found = fitted(names=named("unreal"), extras=extras)
    rig = found.rig
    extra = rig.joint_names.index("spine_015")
    parents = list(rig.parents)
    chest = found.bones["chest"]
    parents[chest] = extra
    from dataclasses import replace

    order = sorted(range(rig.joint_count), key=lambda j: (len(_line(parents, j)), j))
    place = {joint: index for index, joint in enumerate(order)}
    moved = replace(
        rig,
        joint_names=tuple(rig.joint_names[j] for j in order),
        nodes=tuple(rig.nodes[j] for j in order),
        parents=tuple(place.get(parents[j], -1) for j in order),
        rest=rig.rest[order],
        bind=rig.bind[order],
        skinned=rig.skinned[order],
        weighted=rig.weighted[order],
    )
    from roam_character.retargeting.proportions import fit
    from roam_character.rigs.mapping import map_bones

    again = fit(moved, map_bones(moved))
    turns = np.tile(BASE.rest_rotations.astype(float), (2, 1, 1))
    turns[1, BASE.index("chest")] = quat_from_rotvec(np.array([0.8, 0, 0]))
    clip = Clip(again.skeleton, 30.0, np.zeros((2, 3), np.float32), turns.astype(np.float32))
    motion = onto_rig(again, clip)
    worlds = motion.worlds()[:, place[extra], :3, :3]
    turned = worlds[1] @ worlds[0].T
    assert np.arccos((np.trace(turned) - 1) / 2) == pytest.approx(0.4, abs=0.02)
    gap = motion.worlds()[:, again.bones["head"], :3, 3] - clip.positions()[:, BASE.index("head")]
    assert np.abs(gap).max() < 1e-3


def _line(parents, joint):
    found = []
    while (joint := parents[joint]) >= 0:
        found.append(joint)
    return found


def test_another_skeleton_is_refused(fitted, bending):
    with pytest.raises(ValueError, match="another skeleton"):
        onto_rig(fitted(names=named("unreal"), size=0.8), bending(BASE))


def test_signs_of_quaternions_do_not_jump():
    angles = np.linspace(0, 8 * np.pi, 200)
    turns = quat_from_rotvec(np.stack([angles, 0 * angles, 0 * angles], axis=-1))
    turns[50:80] *= -1
    smooth = continuous(turns)
    assert (np.sum(smooth[1:] * smooth[:-1], axis=-1) > 0).all()
