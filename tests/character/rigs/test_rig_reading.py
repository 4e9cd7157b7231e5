"""Characters from every kind of file that is read; what cannot be read says why."""

import json

import numpy as np
import pytest
from rig_maker import BASE, character, named
from roam_character.clip import Clip
from roam_character.documents.bvh import write_bvh
from roam_character.formats import registry
from roam_character.formats.scene import Scene
from roam_character.retargeting.onto_rig import onto_rig
from roam_character.retargeting.proportions import fit
from roam_character.rigs.mapping import map_bones
from roam_character.rigs.reading import read_rig
from roam_character.rigs.rig import RigError


def gap(rig):
    return float(np.linalg.norm(rig.rest[:, :3, 3] - rig.bind[:, :3, 3], axis=-1).max())


def test_bind_pose_and_rest_pose_are_told_apart(rig_of):
    assert gap(rig_of(names=named("unreal"))) < 1e-5
    striding = rig_of(names=named("unreal"), stride=40)
    standing = rig_of(names=named("unreal"))
    assert gap(striding) > 0.3
    np.testing.assert_allclose(striding.bind[:, :3, 3], standing.bind[:, :3, 3], atol=1e-5)


def test_a_scaled_armature_gives_metres(rig_of):
    plain, scaled = rig_of(names=named("unreal")), rig_of(names=named("unreal"), node_scale=100.0)
    np.testing.assert_allclose(scaled.rest[:, :3, 3], plain.rest[:, :3, 3], atol=1e-4)
    np.testing.assert_allclose(scaled.bind[:, :3, 3], plain.bind[:, :3, 3], atol=1e-4)


def test_a_mesh_bound_in_another_space_is_brought_back(rig_of):
    """Exporters that keep the mesh's own space (Z up, centimetres) store inverse bind matrices in it."""
    document = character(names=named("unreal"))
    space = np.diag([100.0, 100.0, 100.0, 1.0])
    space[:3, :3] = 100.0 * np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    inverse = document.values(document.json["skins"][0]["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    moved = (inverse @ np.linalg.inv(space)).transpose(0, 2, 1)
    document.json["skins"][0]["inverseBindMatrices"] = document.accessor(moved)
    assert gap(rig_of(document)) < 1e-4


def test_a_gltf_with_its_buffer_beside_it(tmp_path):
    document = character(names=named("mixamo"))
    content = {**document.json, "buffers": [{"uri": "hero%20data.bin", "byteLength": len(document.buffer)}]}
    (tmp_path / "hero data.bin").write_bytes(bytes(document.buffer))
    (tmp_path / "hero.gltf").write_text(json.dumps(content))
    assert map_bones(read_rig(tmp_path / "hero.gltf")).family == "Mixamo"
    (tmp_path / "hero data.bin").unlink()
    with pytest.raises(RigError, match=r"hero data\.bin"):
        read_rig(tmp_path / "hero.gltf")


def test_a_buffer_outside_the_folder_is_not_read(tmp_path):
    document = character()
    content = {**document.json, "buffers": [{"uri": "../secret.bin", "byteLength": len(document.buffer)}]}
    (tmp_path / "secret.bin").write_bytes(bytes(document.buffer))
    (tmp_path / "in").mkdir()
    (tmp_path / "in/hero.gltf").write_text(json.dumps(content))
    with pytest.raises(RigError, match="missing"):
        read_rig(tmp_path / "in/hero.gltf")


def test_bvh(tmp_path):
    roots = np.array([[0.0, 1.0, 0.0]] * 2, np.float32)
    write_bvh(tmp_path / "hero.bvh", Clip(BASE, 30.0, roots, np.tile(BASE.rest_rotations, (2, 1, 1))))
    rig = read_rig(tmp_path / "hero.bvh")
    found = map_bones(rig)
    assert found.names(rig) == {bone: bone for bone in BASE.joint_names}
    assert any("no mesh" in note for note in rig.notes)


@pytest.mark.parametrize("ending", ["usda", "usdc", "usdz"])
def test_usd(rig_of, tmp_path, ending):
    pytest.importorskip("pxr", reason="reading USD needs usd-core")
    hero = rig_of(names=named("unreal"), arms_down=40)
    own = fit(hero, map_bones(hero))
    clip = Clip(own.skeleton, 30.0, np.zeros((3, 3), np.float32), np.tile(BASE.rest_rotations, (3, 1, 1)))
    registry.write(tmp_path / f"again.{ending}", Scene(clip, character=onto_rig(own, clip)))
    rig = read_rig(tmp_path / f"again.{ending}")
    found = map_bones(rig)
    assert found.names(rig) == named("unreal")
    again = fit(rig, found)
    np.testing.assert_allclose(again.skeleton.rest_offsets, own.skeleton.rest_offsets, atol=1e-3)


def test_what_is_no_character_says_so(tmp_path):
    for name, content, reason in (
        ("hero.glb", b"glTF" + bytes(40), "another version"),
        ("hero.vrm", b"PK\x03\x04", "not a readable glTF"),
        ("hero.bvh", b"HIERARCHY", "no joints"),
        ("hero.max", b"", "no known character format"),
        ("hero.fbx", b"Kaydara nothing", r"hero\.fbx cannot be read|needs ufbx"),
        ("hero.usdz", b"nothing", r"hero\.usdz cannot be read|needs usd-core"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(RigError, match=reason) as caught:
            read_rig(tmp_path / name)
        assert caught.value.remedy
    with pytest.raises(RigError, match="there is no file"):
        read_rig(tmp_path / "nobody.glb")
