"""Bones of foreign rigs are told by their words, their tree and their shape; nothing is invented."""

import json
from dataclasses import replace

import numpy as np
import pytest
from rig_maker import BASE, FAMILIES, character, named
from roam_character.documents.gltf_document import GltfDocument
from roam_character.rigs.mapping import map_bones, read_map
from roam_character.rigs.rig import RigError


@pytest.mark.parametrize("family", FAMILIES)
def test_names_of_every_family(rig_of, family):
    names = named(family)
    rig = rig_of(names=names, arms_down=35, seed=3)
    found = map_bones(rig)
    assert found.names(rig) == names
    assert found.overall >= 0.9


@pytest.mark.parametrize("yaw", [0, 90, 180, 250])
@pytest.mark.parametrize("arms_down", [0, 45])
def test_joints_without_names(rig_of, yaw, arms_down):
    unnamed = dict.fromkeys(BASE.joint_names, "")
    rig = rig_of(names=unnamed, yaw=yaw, arms_down=arms_down)
    found = map_bones(rig)
    # nodes stand in the order of the bones, behind the armature
    assert found.names(rig) == {bone: f"#{index + 1}" for index, bone in enumerate(BASE.joint_names)}
    assert found.overall < 0.7  # told by shape alone: not sure


def test_thighs_below_the_spine_and_collar_bones_below_the_neck(rig_of):
    names = named("biped")
    moved = {"leftUpperLeg": "spine", "rightUpperLeg": "spine", "leftShoulder": "neck", "rightShoulder": "neck"}
    rig = rig_of(names=names, parents=moved)
    assert map_bones(rig).names(rig) == names


def test_feet_below_the_root_and_hips_called_body(rig_of):
    names = {**named("rigify"), "hips": "Body", "spine": "Abdomen", "chest": "Torso",
             "upperChest": "Chest", "neck": "Neck", "head": "Head"}  # fmt: skip
    extras = [("Hips", "hips", (0.0, 0.01, 0.0))]
    rig = rig_of(names=names, parents={"leftFoot": "", "rightFoot": ""}, extras=extras)
    assert map_bones(rig).names(rig) == names


def test_helpers_twists_fingers_and_ik_joints_are_no_bones(rig_of):
    names = named("unreal")
    extras = [
        ("upperarm_twist_01_l", "leftUpperArm", (0.1, 0, 0)), ("lowerarm_twist_01_l", "leftLowerArm", (0.12, 0, 0)),
        ("thigh_twist_01_r", "rightUpperLeg", (0, -0.2, 0)), ("ik_foot_l", "hips", (0.1, -0.9, 0)),
        ("ik_hand_r", "hips", (-0.7, 0.4, 0)), ("index_01_l", "leftHand", (0.09, 0, 0.02)),
        ("thumb_01_l", "leftHand", (0.03, 0, 0.03)), ("head_end", "head", (0, 0.2, 0)),
        ("hair_ball_l", "head", (0.1, 0.2, 0)), ("foot_ctrl_l", "hips", (0.1, -0.8, 0.1)),
    ]  # fmt: skip
    rig = rig_of(names=names, extras=extras)
    assert map_bones(rig).names(rig) == names


def test_what_a_rig_lacks_is_not_made_up(rig_of):
    lacking = ("upperChest", "neck", "leftShoulder", "rightShoulder", "leftToes", "rightToes")
    names = named("unreal")
    rig = rig_of(names=names, without=lacking)
    assert map_bones(rig).names(rig) == {b: None if b in lacking else n for b, n in names.items()}


def test_bones_that_a_vrm_file_declares_win_over_names(rig_of):
    names = {bone: f"joint {index}" for index, bone in enumerate(BASE.joint_names)}
    document = character(names=names)
    bones = {bone: {"node": index + 1} for index, bone in enumerate(BASE.joint_names)}
    document.json["extensions"] = {"VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}}
    rig = rig_of(document, ending="vrm")
    assert map_bones(rig).names(rig) == names
    assert map_bones(rig).overall == 1.0
    old = [{"bone": bone, "node": item["node"]} for bone, item in bones.items()]
    document.json["extensions"] = {"VRM": {"humanoid": {"humanBones": old}}}
    assert map_bones(rig_of(document, ending="vrm")).overall == 1.0


def test_a_rig_that_lies_on_its_back_is_stood_up(rig_of):
    rig = rig_of(names=named("mixamo"))
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]  # its up is the file's +Z
    lying = replace(rig, rest=turn @ rig.rest, bind=turn @ rig.bind)
    assert map_bones(lying).bones == map_bones(rig).bones


def test_an_override_wins_and_may_say_that_there_is_none(rig_of):
    rig = rig_of(names=named("smpl"))
    found = map_bones(rig, {"leftHand": "L_Elbow", "leftLowerArm": "L_Shoulder", "leftUpperArm": "L_Collar",
                            "leftShoulder": None, "rightToes": None})  # fmt: skip
    names = found.names(rig)
    assert names["leftUpperArm"] == "L_Collar"
    assert names["leftShoulder"] is None
    assert names["rightToes"] is None
    assert found.confidence["leftHand"] == 1.0


def test_map_files_are_checked(rig_of, tmp_path):
    path = tmp_path / "hero.map.json"
    path.write_text(json.dumps({"hips": "Pelvis", "leftToes": None}))
    rig = rig_of(names=named("smpl"))
    assert map_bones(rig, read_map(path)).names(rig)["leftToes"] is None
    path.write_text(json.dumps({"hip": "Pelvis"}))
    with pytest.raises(RigError, match="unknown bones hip"):
        read_map(path)
    path.write_text("[]")
    with pytest.raises(RigError, match="no map file"):
        read_map(path)
    with pytest.raises(RigError, match="no joint 'Pelvi'"):
        map_bones(rig, {"hips": "Pelvi"})


def rigid_toy() -> GltfDocument:
    """A figure of one piece a limb, as low-poly packs have them."""
    document = GltfDocument()
    places = {"torso": (0, 0.5, 0), "leg-left": (0.1, 0.2, 0), "leg-right": (-0.1, 0.2, 0), "antenna": (0, 0.9, 0),
              "arm-left": (0.3, 0.6, 0), "arm-right": (-0.3, 0.6, 0)}  # fmt: skip
    for name, place in places.items():
        document.add("nodes", {"name": name, "translation": list(place)})
    document.json["nodes"][0]["children"] = [1, 2, 3, 4, 5]
    document.add("scenes", {"nodes": [0]})
    return document


def test_a_toy_of_one_piece_a_limb_is_refused(rig_of):
    with pytest.raises(RigError, match="no humanoid") as caught:
        map_bones(rig_of(rigid_toy()))
    assert "leftLowerArm" in str(caught.value)
    assert "--map" in caught.value.remedy


def test_an_animal_with_human_names_is_refused(rig_of):
    rig = rig_of(names=named("vrm"), turned_joints=False)
    bind = rig.bind.copy()
    front = ("spine", "chest", "upperChest", "neck", "head", "Shoulder", "UpperArm", "LowerArm", "Hand")
    for joint, name in enumerate(rig.joint_names):
        if name.endswith(front):  # the trunk lies level, the front legs hang down
            x, y, _ = bind[joint, :3, 3]
            bind[joint, :3, 3] = (x * 0.3, 0.9 - abs(x), y - 0.9)
    with pytest.raises(RigError, match="like an animal"):
        map_bones(replace(rig, bind=bind))


def test_a_table_is_refused(rig_of):
    document = GltfDocument()
    document.add("nodes", {"name": "table", "children": [1, 2, 3, 4]})
    for x, z in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        document.add("nodes", {"name": "leg", "translation": [x, -0.7, z]})
    document.add("scenes", {"nodes": [0]})
    with pytest.raises(RigError, match="no humanoid"):
        map_bones(rig_of(document))
