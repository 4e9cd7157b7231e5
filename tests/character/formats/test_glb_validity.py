"""Khronos' validator finds nothing in a GLB: no error, no warning, no information, no hint."""

import json
import struct

import numpy as np
from roam_character.documents.gltf_document import GltfDocument
from roam_character.formats.glb import glb_bytes, mesh_document, scene_document
from roam_character.formats.scene import Furniture, Scene

_SCRIPT = """
const validator = require("gltf-validator"), fs = require("fs");
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2]))).then(report => {
  console.log(JSON.stringify(report.issues.messages.map(m => m.code + " " + m.pointer)));
});
"""
CUBE = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                  [0, 6, 4], [1, 5, 7], [1, 7, 3]])  # fmt: skip


def test_a_motion_beside_furniture(turning, node, tmp_path):
    (tmp_path / "a.glb").write_bytes(glb_bytes(turning, mesh=(CUBE, FACES)))
    assert node(_SCRIPT, str(tmp_path / "a.glb"), needs="gltf-validator") == []


def test_a_pose_beside_a_cloud(turning, node, tmp_path):
    scene = Scene(turning.pose(9), furniture=Furniture(mesh_document(CUBE, None), np.eye(4)))
    (tmp_path / "a.glb").write_bytes(scene_document(scene).to_bytes())
    assert node(_SCRIPT, str(tmp_path / "a.glb"), needs="gltf-validator") == []


def textured_chair() -> GltfDocument:
    """Two boxes in a hierarchy, with materials, normals, texture coordinates and a picture."""
    document = GltfDocument()
    pixel = bytes.fromhex(
        "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c49444154789c63606060000000040001"
        "27349a0b0000000049454e44ae426082"
    )
    document.add("images", {"bufferView": document.view(pixel), "mimeType": "image/png", "name": "wood"})
    document.add("samplers", {"wrapS": 10497})
    document.add("textures", {"source": 0, "sampler": 0})
    document.add("materials", {"name": "wood", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    document.add("materials", {"name": "metal", "pbrMetallicRoughness": {"metallicFactor": 1.0}})
    points, normals = CUBE - 0.5, (CUBE - 0.5) / np.linalg.norm(CUBE - 0.5, axis=-1, keepdims=True)
    attributes = {"POSITION": document.accessor(points, bounds=True), "NORMAL": document.accessor(normals),
                  "TEXCOORD_0": document.accessor(CUBE[:, :2])}  # fmt: skip
    indices = document.accessor(FACES.reshape(-1), "I")
    for material in (0, 1):
        kept = {name: a for name, a in attributes.items() if material == 0 or name != "TEXCOORD_0"}
        primitive = {"attributes": kept, "indices": indices, "material": material}
        document.add("meshes", {"name": "part", "primitives": [primitive]})
    document.add("nodes", {"name": "chair", "children": [1, 2], "translation": [0.0, 0.5, 0.0]})
    document.add("nodes", {"name": "seat", "mesh": 0, "scale": [0.5, 0.1, 0.5]})
    document.add("nodes", {"name": "back", "mesh": 1, "scale": [0.5, 0.5, 0.1], "translation": [0.0, 0.3, -0.2]})
    document.scene_roots()
    return document


def test_furniture_keeps_materials_textures_normals_and_hierarchy(turning, node, tmp_path):
    place = np.eye(4)
    place[:3, 3] = (0, 0, 2)
    chair = textured_chair()
    document = GltfDocument.read(scene_document(Scene(turning, furniture=Furniture(chair, place))).to_bytes())
    nodes = {item["name"]: item for item in document.json["nodes"]}
    assert [document.json["nodes"][c]["name"] for c in nodes["chair"]["children"]] == ["seat", "back"]
    primitive = document.json["meshes"][nodes["seat"]["mesh"]]["primitives"][0]
    material = document.json["materials"][primitive["material"]]
    assert material["name"] == "wood"
    texture = document.json["textures"][material["pbrMetallicRoughness"]["baseColorTexture"]["index"]]
    assert document.json["images"][texture["source"]]["name"] == "wood"
    for name in ("POSITION", "NORMAL", "TEXCOORD_0"):
        before = chair.values(chair.json["meshes"][0]["primitives"][0]["attributes"][name])
        np.testing.assert_allclose(document.values(primitive["attributes"][name]), before, atol=1e-6)
    worlds = document.node_worlds()
    seat = document.json["nodes"].index(nodes["seat"])
    np.testing.assert_allclose(worlds[seat][:3, 3], [0, 0.5, 2])
    (tmp_path / "a.glb").write_bytes(document.to_bytes())
    assert node(_SCRIPT, str(tmp_path / "a.glb"), needs="gltf-validator") == []


def test_indices_of_extensions_move_along():
    chair = textured_chair()
    chair.json["materials"][0]["extensions"] = {"KHR_materials_clearcoat": {"clearcoatTexture": {"index": 0}}}
    chair.json["textures"][0]["extensions"] = {"KHR_texture_basisu": {"source": 0}}
    mine = chair.accessor(np.zeros((3, 3)))
    chair.json["nodes"][1]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": mine}},
                                            "KHR_lights_punctual": {"light": 0}}  # fmt: skip
    chair.json["extensionsUsed"] = ["EXT_mesh_gpu_instancing", "KHR_lights_punctual"]
    other = textured_chair()
    shift = len(other.json["accessors"])
    other.merge(chair)
    moved = other.json["nodes"][4]["extensions"]
    assert moved == {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": mine + shift}}}
    assert other.json["materials"][2]["extensions"]["KHR_materials_clearcoat"]["clearcoatTexture"]["index"] == 1
    assert other.json["textures"][1]["extensions"]["KHR_texture_basisu"]["source"] == 1
    assert other.json["extensionsUsed"] == ["EXT_mesh_gpu_instancing"]
    assert chair.json["nodes"][1]["extensions"]["KHR_lights_punctual"] == {"light": 0}  # the source is left as it was


def test_the_container_is_well_formed(turning):
    data = glb_bytes(turning)
    assert struct.unpack_from("<4sII", data) == (b"glTF", 2, len(data))
    length = struct.unpack_from("<I", data, 12)[0]
    assert json.loads(data[20 : 20 + length])["asset"]["version"] == "2.0"
