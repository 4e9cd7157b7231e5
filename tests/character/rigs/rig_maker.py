"""Small characters of our own making, with the traps that real ones have; no file of anybody else's."""

from collections.abc import Mapping, Sequence

import numpy as np
from roam_character.documents.gltf_document import GltfDocument, compose, decompose
from roam_character.rotation import quat_from_rotvec, quat_mul, quat_normalize, quat_rotate
from roam_character.skeleton import humanoid_skeleton

BASE = humanoid_skeleton()
SIDED = ("Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "Toes")

# Names of the 22 bones in families of rigs; {s}/{S} are l/L, {side}/{Side} left/Left.
FAMILIES: dict[str, dict[str, str]] = {
    "vrm": {"hips": "hips", "spine": "spine", "chest": "chest", "upperChest": "upperChest", "neck": "neck",
            "head": "head", **{b: "{side}" + b for b in SIDED}},
    "mixamo": {"hips": "mixamorig:Hips", "spine": "mixamorig:Spine", "chest": "mixamorig:Spine1",
               "upperChest": "mixamorig:Spine2", "neck": "mixamorig:Neck", "head": "mixamorig:Head",
               "Shoulder": "mixamorig:{Side}Shoulder", "UpperArm": "mixamorig:{Side}Arm",
               "LowerArm": "mixamorig:{Side}ForeArm", "Hand": "mixamorig:{Side}Hand",
               "UpperLeg": "mixamorig:{Side}UpLeg", "LowerLeg": "mixamorig:{Side}Leg", "Foot": "mixamorig:{Side}Foot",
               "Toes": "mixamorig:{Side}ToeBase"},
    "unreal": {"hips": "pelvis", "spine": "spine_01", "chest": "spine_02", "upperChest": "spine_03",
               "neck": "neck_01", "head": "head", "Shoulder": "clavicle_{s}", "UpperArm": "upperarm_{s}",
               "LowerArm": "lowerarm_{s}", "Hand": "hand_{s}", "UpperLeg": "thigh_{s}", "LowerLeg": "calf_{s}",
               "Foot": "foot_{s}", "Toes": "ball_{s}"},
    "biped": {"hips": "Bip001 Pelvis", "spine": "Bip001 Spine", "chest": "Bip001 Spine1",
              "upperChest": "Bip001 Spine2", "neck": "Bip001 Neck", "head": "Bip001 Head",
              "Shoulder": "Bip001 {S} Clavicle", "UpperArm": "Bip001 {S} UpperArm", "LowerArm": "Bip001 {S} Forearm",
              "Hand": "Bip001 {S} Hand", "UpperLeg": "Bip001 {S} Thigh", "LowerLeg": "Bip001 {S} Calf",
              "Foot": "Bip001 {S} Foot", "Toes": "Bip001 {S} Toe0"},
    "rigify": {"hips": "spine", "spine": "spine.001", "chest": "spine.002", "upperChest": "spine.003",
               "neck": "spine.004", "head": "spine.006", "Shoulder": "shoulder.{S}", "UpperArm": "upper_arm.{S}",
               "LowerArm": "forearm.{S}", "Hand": "hand.{S}", "UpperLeg": "thigh.{S}", "LowerLeg": "shin.{S}",
               "Foot": "foot.{S}", "Toes": "toe.{S}"},
    "character creator": {"hips": "CC_Base_Hip", "spine": "CC_Base_Waist", "chest": "CC_Base_Spine01",
                          "upperChest": "CC_Base_Spine02", "neck": "CC_Base_NeckTwist01", "head": "CC_Base_Head",
                          "Shoulder": "CC_Base_{S}_Clavicle", "UpperArm": "CC_Base_{S}_Upperarm",
                          "LowerArm": "CC_Base_{S}_Forearm", "Hand": "CC_Base_{S}_Hand",
                          "UpperLeg": "CC_Base_{S}_Thigh", "LowerLeg": "CC_Base_{S}_Calf",
                          "Foot": "CC_Base_{S}_Foot", "Toes": "CC_Base_{S}_ToeBase"},
    "smpl": {"hips": "Pelvis", "spine": "Spine1", "chest": "Spine2", "upperChest": "Spine3", "neck": "Neck",
             "head": "Head", "Shoulder": "{S}_Collar", "UpperArm": "{S}_Shoulder", "LowerArm": "{S}_Elbow",
             "Hand": "{S}_Wrist", "UpperLeg": "{S}_Hip", "LowerLeg": "{S}_Knee", "Foot": "{S}_Ankle",
             "Toes": "{S}_Foot"},
    "smplx": {"hips": "pelvis", "spine": "spine1", "chest": "spine2", "upperChest": "spine3", "neck": "neck",
              "head": "head", "Shoulder": "{side}_collar", "UpperArm": "{side}_shoulder",
              "LowerArm": "{side}_elbow", "Hand": "{side}_wrist", "UpperLeg": "{side}_hip",
              "LowerLeg": "{side}_knee", "Foot": "{side}_ankle", "Toes": "{side}_foot"},
    "acclaim": {"hips": "root", "spine": "lowerback", "chest": "upperback", "upperChest": "thorax",
                "neck": "lowerneck", "head": "head", "Shoulder": "{s}clavicle", "UpperArm": "{s}humerus",
                "LowerArm": "{s}radius", "Hand": "{s}wrist", "UpperLeg": "{s}femur", "LowerLeg": "{s}tibia",
                "Foot": "{s}foot", "Toes": "{s}toes"},
    "xsens": {"hips": "Hips", "spine": "Chest", "chest": "Chest2", "upperChest": "Chest4", "neck": "Neck",
              "head": "Head", "Shoulder": "{Side}Collar", "UpperArm": "{Side}Shoulder", "LowerArm": "{Side}Elbow",
              "Hand": "{Side}Wrist", "UpperLeg": "{Side}Hip", "LowerLeg": "{Side}Knee", "Foot": "{Side}Ankle",
              "Toes": "{Side}Toe"},
    "xsens mvn": {"hips": "Pelvis", "spine": "L5", "chest": "T12", "upperChest": "T8", "neck": "Neck",
                  "head": "Head", "Shoulder": "{Side}Shoulder", "UpperArm": "{Side}UpperArm",
                  "LowerArm": "{Side}ForeArm", "Hand": "{Side}Hand", "UpperLeg": "{Side}UpperLeg",
                  "LowerLeg": "{Side}LowerLeg", "Foot": "{Side}Foot", "Toes": "{Side}Toe"},
    "rokoko": {"hips": "Hips", "spine": "Spine1", "chest": "Spine2", "upperChest": "Spine4", "neck": "Neck",
               "head": "Head", "Shoulder": "{Side}Shoulder", "UpperArm": "{Side}Arm", "LowerArm": "{Side}ForeArm",
               "Hand": "{Side}Hand", "UpperLeg": "{Side}Thigh", "LowerLeg": "{Side}Shin", "Foot": "{Side}Foot",
               "Toes": "{Side}Toe"},
    "daz": {"hips": "hip", "spine": "abdomenLower", "chest": "abdomenUpper", "upperChest": "chestUpper",
            "neck": "neckLower", "head": "head", "Shoulder": "{s}Collar", "UpperArm": "{s}ShldrBend",
            "LowerArm": "{s}ForearmBend", "Hand": "{s}Hand", "UpperLeg": "{s}ThighBend", "LowerLeg": "{s}Shin",
            "Foot": "{s}Foot", "Toes": "{s}Toe"},
    "vroid": {"hips": "J_Bip_C_Hips", "spine": "J_Bip_C_Spine", "chest": "J_Bip_C_Chest",
              "upperChest": "J_Bip_C_UpperChest", "neck": "J_Bip_C_Neck", "head": "J_Bip_C_Head",
              **{b: "J_Bip_{S}_" + b for b in SIDED}},
    "cats": {"hips": "Hips", "spine": "Spine", "chest": "Chest", "upperChest": "Upper Chest", "neck": "Neck",
             "head": "Head", "Shoulder": "{Side} shoulder", "UpperArm": "{Side} arm", "LowerArm": "{Side} elbow",
             "Hand": "{Side} wrist", "UpperLeg": "{Side} leg", "LowerLeg": "{Side} knee", "Foot": "{Side} ankle",
             "Toes": "{Side} toe"},
    "mmd": {"hips": "センター", "spine": "上半身", "chest": "上半身2", "upperChest": "上半身3", "neck": "首",
            "head": "頭", "Shoulder": "{jp}肩", "UpperArm": "{jp}腕", "LowerArm": "{jp}ひじ", "Hand": "{jp}手首",
            "UpperLeg": "{jp}足", "LowerLeg": "{jp}ひざ", "Foot": "{jp}足首", "Toes": "{jp}つま先"},
}  # fmt: skip


def named(family: str) -> dict[str, str]:
    """VRM bone -> joint name in a family."""
    table, found = FAMILIES[family], {}
    for bone in BASE.joint_names:
        side = "left" if bone.startswith("left") else "right" if bone.startswith("right") else ""
        name = table[bone.removeprefix(side) if side else bone]
        found[bone] = name.format(
            s=side[:1], S=side[:1].upper(), side=side, Side=side.capitalize(), jp="左" if side == "left" else "右"
        )
    return found


def character(
    names: Mapping[str, str] | None = None,
    *,
    without: Sequence[str] = (),
    parents: Mapping[str, str] | None = None,
    extras: Sequence[tuple[str, str, tuple[float, float, float]]] = (),
    arms_down: float = 0.0,
    elbows_bent: float = 0.0,
    lean: float = 0.0,
    yaw: float = 0.0,
    size: float = 1.0,
    node_scale: float = 1.0,
    turned_joints: bool = True,
    stride: float = 0.0,
    skinned: bool = True,
    proportions: Mapping[str, float] | None = None,
    seed: int = 0,
) -> GltfDocument:
    """A character as GLB document.

    `parents` hangs bones elsewhere ("" is the root node), `extras` are further joints (name, bone above, offset [m]);
    angles [degree] change the bind pose, `stride` the nodes' rest pose away from it; `yaw` is where it faces;
    `node_scale` puts a scale on the armature node and its inverse into the joints.
    """
    names, rng = names or {bone: bone for bone in BASE.joint_names}, np.random.default_rng(seed)
    bones = [bone for bone in BASE.joint_names if bone not in without]
    places, turns = _bind_pose(arms_down, elbows_bent, lean, yaw, proportions or {})
    joints = [(names[bone], places[bone] * size, turns[bone], bone) for bone in bones]
    for name, above, offset in extras:
        at = places[above] + quat_rotate(turns[above], np.array(offset))
        joints.append((name, at * size, turns[above], ""))
    owners = _owners(bones, parents or {}, extras)
    worlds = []
    for _, place, turn, _ in joints:
        own = quat_normalize(rng.normal(size=4)) if turned_joints else np.array([0, 0, 0, 1.0])
        worlds.append(compose(place, quat_mul(turn, own), np.ones(3)))
    document = GltfDocument()
    armature = document.add("nodes", {"name": "Armature", "scale": [node_scale] * 3, "children": []})
    shrink = np.diag([1 / node_scale] * 3 + [1.0])
    for index, (name, _, _, _) in enumerate(joints):
        above = owners[index]
        local = shrink @ worlds[index] if above < 0 else np.linalg.inv(worlds[above]) @ worlds[index]
        place, turn, scale = decompose(local)
        node = {"name": name, "translation": place.tolist(), "rotation": turn.tolist(), "scale": scale.tolist()}
        document.add("nodes", node if name else {k: v for k, v in node.items() if k != "name"})
        document.json["nodes"][armature if above < 0 else above + 1].setdefault("children", []).append(index + 1)
    document.add("scenes", {"nodes": [armature]})
    document.json["scene"] = 0
    if skinned:
        _add_skin(document, joints, worlds, size)
    if stride:
        _stride(document, joints, stride)
    return document


def _bind_pose(
    arms_down: float, elbows_bent: float, lean: float, yaw: float, proportions: Mapping[str, float]
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """World places and turns of the bones."""
    rest = BASE.rest_offsets.astype(float).copy()
    for bone, factor in proportions.items():
        rest[BASE.index(bone)] *= factor
    turns: dict[str, np.ndarray] = {}
    places: dict[str, np.ndarray] = {}
    whole = quat_from_rotvec(np.array([0.0, np.radians(yaw), 0.0]))
    for joint, bone in enumerate(BASE.joint_names):
        parent = BASE.parents[joint]
        own = np.zeros(3)
        side = 1.0 if bone.startswith("left") else -1.0
        if bone == "hips":
            own[0] = np.radians(lean)
        if bone.endswith("UpperArm"):
            own[2] = -side * np.radians(arms_down)
        if bone.endswith("LowerArm"):
            own[1] = -side * np.radians(elbows_bent)
        above = whole if parent < 0 else turns[BASE.joint_names[parent]]
        turns[bone] = quat_mul(above, quat_from_rotvec(own))
        base = np.zeros(3) if parent < 0 else places[BASE.joint_names[parent]]
        places[bone] = base + quat_rotate(above, rest[joint])
    return places, turns


def _owners(bones: list[str], moved: Mapping[str, str], extras: Sequence[tuple[str, str, object]]) -> list[int]:
    """Index of the joint above each joint, -1 for the armature."""
    found = []
    for bone in bones:
        above = moved.get(bone)
        if above is None:
            parent = BASE.parents[BASE.index(bone)]
            while parent >= 0 and BASE.joint_names[parent] not in bones:
                parent = BASE.parents[parent]
            above = BASE.joint_names[parent] if parent >= 0 else ""
        found.append(bones.index(above) if above else -1)
    return [*found, *(bones.index(above) for _, above, _ in extras)]


def _add_skin(document: GltfDocument, joints: list, worlds: list[np.ndarray], size: float) -> None:
    """A small box about every bone's joint (feet: down to the floor), moved by it; extras move nothing."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * 0.02
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([(a, b, c) for q in sides for a, b, c in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))])
    points, slots, triangles = [], [], []
    for slot, (_, place, _, bone) in enumerate(joints):
        if not bone:
            continue
        triangles.append(faces + 8 * len(points))
        points.append(place + corners * size)
        slots += [slot] * 8
    vertices = np.concatenate(points)
    joint_rows, weights = np.zeros((len(vertices), 4), int), np.zeros((len(vertices), 4))
    joint_rows[:, 0], weights[:, 0] = slots, 1
    attributes = {
        "POSITION": document.accessor(vertices, target=34962, bounds=True),
        "JOINTS_0": document.accessor(joint_rows, "H", target=34962),
        "WEIGHTS_0": document.accessor(weights, target=34962),
    }
    indices = document.accessor(np.concatenate(triangles).reshape(-1), "I", target=34963)
    material = document.material("cloth", (0.2, 0.4, 0.8, 1.0))
    primitive = {"attributes": attributes, "indices": indices, "material": material}
    mesh = document.add("meshes", {"name": "figure", "primitives": [primitive]})
    inverse = np.stack([np.linalg.inv(world) for world in worlds]).transpose(0, 2, 1)
    skin = {"joints": list(range(1, len(joints) + 1)), "inverseBindMatrices": document.accessor(inverse)}
    node = {"name": "figure", "mesh": mesh, "skin": document.add("skins", skin)}
    document.scene_roots().append(document.add("nodes", node))


def _stride(document: GltfDocument, joints: list, degrees: float) -> None:
    """Turns thighs and arms of the nodes, as a file saved in the middle of an animation has them."""
    for index, (_, _, _, bone) in enumerate(joints):
        if bone.endswith(("UpperLeg", "UpperArm")):
            node = document.json["nodes"][index + 1]
            turn = quat_from_rotvec(np.array([np.radians(degrees), 0.0, 0.0]))
            node["rotation"] = quat_mul(np.array(node["rotation"]), turn).tolist()
