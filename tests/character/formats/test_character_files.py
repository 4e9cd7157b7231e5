"""A user's character in the formats that are written: its own mesh, materials, skin; the motion as we have it."""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "rigs"))

from rig_maker import BASE, character, named
from roam_character.clip import Clip
from roam_character.documents.bvh import read_bvh
from roam_character.documents.gltf_document import GltfDocument, compose, parents_first
from roam_character.formats import registry
from roam_character.formats.scene import Scene
from roam_character.retargeting.onto_rig import onto_rig
from roam_character.retargeting.proportions import fit
from roam_character.rigs.mapping import map_bones
from roam_character.rigs.reading import read_rig

TRAPS = {
    "plain": {}, "4.9 m": {"size": 2.9}, "A pose": {"arms_down": 50}, "stride": {"stride": 50},
    "thighs below the spine": {"parents": {"leftUpperLeg": "spine", "rightUpperLeg": "spine"}},
    "feet below the root": {"parents": {"leftFoot": "", "rightFoot": ""}}, "no mesh": {"skinned": False},
}  # fmt: skip


@pytest.fixture
def scene(tmp_path, turning):
    """A scene of a character of our own making that performs the motion."""

    def make(*, still: bool = False, **options):
        (tmp_path / "hero.glb").write_bytes(character(names=named("unreal"), **options).to_bytes())
        rig = read_rig(tmp_path / "hero.glb")
        own = fit(rig, map_bones(rig))
        clip = Clip(own.skeleton, 30.0, turning.root_positions, turning.rotations)
        content = clip.pose(12) if still else clip
        return Scene(content, character=onto_rig(own, content))

    return make


def worlds_at(document: GltfDocument, frame: int) -> np.ndarray:
    """World matrices of all nodes at a key of the first animation, by the letter of the specification."""
    nodes = [dict(node) for node in document.json["nodes"]]
    if "animations" in document.json:
        animation = document.json["animations"][0]
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            assert sampler["interpolation"] == "LINEAR"
            values = document.values(sampler["output"])
            nodes[channel["target"]["node"]][channel["target"]["path"]] = values[frame]
    parents, found = document.node_parents(), np.zeros((len(nodes), 4, 4))
    for index in parents_first(parents):
        node = nodes[index]
        local = compose(np.array(node.get("translation", (0, 0, 0)), float),
                        np.array(node.get("rotation", (0, 0, 0, 1)), float),
                        np.array(node.get("scale", (1, 1, 1)), float))  # fmt: skip
        found[index] = local if parents[index] < 0 else found[parents[index]] @ local
    return found


@pytest.mark.parametrize("trap", TRAPS)
def test_glb_has_the_joints_where_the_motion_has_them(scene, tmp_path, trap):
    made = scene(**TRAPS[trap])
    registry.write(tmp_path / "out.glb", made)
    document, own = GltfDocument.read((tmp_path / "out.glb").read_bytes()), made.character.fit
    wanted = made.clip.positions()
    for frame in (0, 17, 39):
        worlds = worlds_at(document, frame)
        for bone, joint in own.bones.items():
            if bone != "hips":
                place = worlds[own.rig.nodes[joint]][:3, 3]
                np.testing.assert_allclose(place, wanted[frame, BASE.index(bone)], atol=1e-3, err_msg=bone)


def test_glb_keeps_mesh_material_skin_and_rest_pose(scene, tmp_path):
    made = scene()
    registry.write(tmp_path / "out.glb", made)
    before = made.character.fit.rig.document
    after = GltfDocument.read((tmp_path / "out.glb").read_bytes())
    count = len(before.json["nodes"])
    assert after.json["nodes"][:count] == before.json["nodes"]
    for kind in ("meshes", "materials", "skins"):
        assert after.json[kind] == before.json[kind]
    position = before.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    np.testing.assert_array_equal(after.values(position), before.values(position))


def test_glb_puts_our_animation_first_and_keeps_the_others(tmp_path, turning):
    document = character(names=named("unreal"))
    times = document.accessor(np.array([0.0, 1.0]), bounds=True)
    turns = document.accessor(np.tile([0.0, 0, 0, 1], (2, 1)))
    sampler = {"input": times, "output": turns, "interpolation": "LINEAR"}
    channel = {"sampler": 0, "target": {"node": 3, "path": "rotation"}}
    document.json["animations"] = [{"name": "wave", "samplers": [sampler], "channels": [channel]}]
    (tmp_path / "hero.glb").write_bytes(document.to_bytes())
    rig = read_rig(tmp_path / "hero.glb")
    own = fit(rig, map_bones(rig))
    clip = Clip(own.skeleton, 30.0, turning.root_positions, turning.rotations)
    registry.write(tmp_path / "out.glb", Scene(clip, character=onto_rig(own, clip), name="sit"))
    after = GltfDocument.read((tmp_path / "out.glb").read_bytes())
    assert [animation["name"] for animation in after.json["animations"]] == ["sit", "wave"]


def test_a_still_pose_is_in_the_nodes(scene, tmp_path):
    made = scene(still=True)
    registry.write(tmp_path / "out.glb", made)
    document, own = GltfDocument.read((tmp_path / "out.glb").read_bytes()), made.character.fit
    assert "animations" not in document.json
    place = document.node_worlds()[own.rig.nodes[own.bones["leftHand"]]][:3, 3]
    np.testing.assert_allclose(place, made.content.positions()[BASE.index("leftHand")], atol=1e-3)


@pytest.mark.parametrize("trap", TRAPS)
def test_bvh_of_the_characters_own_joints(scene, tmp_path, trap):
    made = scene(**TRAPS[trap])
    registry.write(tmp_path / "out.bvh", made)
    back, names = read_bvh(tmp_path / "out.bvh", unit=0.01), named("unreal")
    places, wanted = back.positions(), made.clip.positions()
    for bone in ("leftHand", "rightFoot", "head", "leftToes"):
        gap = places[:, back.skeleton.index(names[bone])] - wanted[:, BASE.index(bone)]
        assert np.abs(gap).max() < 1e-3, bone


def test_vrma_of_the_characters_bones(scene, tmp_path):
    made = scene(without=("upperChest", "neck", "leftToes", "rightToes"))
    registry.write(tmp_path / "out.vrma", made)
    document = GltfDocument.read((tmp_path / "out.vrma").read_bytes())
    bones = document.json["extensions"]["VRMC_vrm_animation"]["humanoid"]["humanBones"]
    assert set(bones) == set(made.character.fit.bones)
    assert all(node["rotation"] == [0, 0, 0, 1] for node in document.json["nodes"])
    worlds = worlds_at(document, 20)
    wanted = made.clip.positions()[20]
    for bone in ("leftHand", "rightFoot", "head"):
        np.testing.assert_allclose(worlds[bones[bone]["node"]][:3, 3], wanted[BASE.index(bone)], atol=3e-3)


def test_csv_has_a_row_a_frame(scene, tmp_path):
    made = scene()
    registry.write(tmp_path / "out.csv", made)
    with (tmp_path / "out.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 40
    place = [float(rows[20][f"hand_l.{axis}"]) for axis in "xyz"]
    np.testing.assert_allclose(place, made.clip.positions()[20, BASE.index("leftHand")], atol=1e-3)
    assert float(rows[30]["time"]) == 1.0


def test_npz_has_the_nodes_local_transforms(scene, tmp_path):
    made = scene()
    registry.write(tmp_path / "out.npz", made)
    with np.load(tmp_path / "out.npz", allow_pickle=False) as saved:
        assert saved["rig_rotations"].shape == (40, made.character.fit.rig.joint_count, 4)
        assert list(saved["rig_joint_names"]) == list(made.character.fit.rig.joint_names)


def test_usd_reads_back_in_its_own_library(scene, tmp_path):
    pytest.importorskip("pxr", reason="writing USD needs usd-core")
    from pxr import Usd, UsdGeom, UsdSkel

    made = scene(size=2.9)
    registry.write(tmp_path / "out.usda", made)
    stage = Usd.Stage.Open(str(tmp_path / "out.usda"))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert stage.GetDefaultPrim().GetPath() == "/Scene"
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (0, 40, 30)
    root = UsdSkel.Root.Find(UsdSkel.Skeleton.Get(stage, "/Scene/Character/Skeleton").GetPrim())
    assert root
    cache = UsdSkel.Cache()
    skeleton = UsdSkel.Skeleton.Get(stage, "/Scene/Character/Skeleton")
    cache.Populate(root, Usd.TraverseInstanceProxies())
    query = cache.GetSkelQuery(skeleton)
    joints = [str(j).rsplit("/", 1)[-1] for j in query.GetJointOrder()]
    for frame in (0, 20, 39):
        placed = query.ComputeJointSkelTransforms(Usd.TimeCode(frame))
        hand = np.array(placed[joints.index("hand_l")].ExtractTranslation())
        wanted = made.clip.positions()[frame, BASE.index("leftHand")]
        np.testing.assert_allclose(hand, wanted, atol=2e-3)
    assert any(prim.IsA(UsdGeom.Mesh) for prim in stage.Traverse())
