import base64
import json
import struct

import numpy as np
import pytest
import trimesh
from box_furniture import box_chair
from roam_goalpose.objects import Limits, ObjectError
from roam_goalpose.objects.reading import read_geometry


def _parts():
    """The JSON and the binary chunk of the box chair."""
    data = box_chair().export(file_type="glb")
    size = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + size]), data[20 + size + 8 :]


def _glb(document, binary):
    text = document if isinstance(document, bytes) else json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def _refused(data, format="glb"):
    with pytest.raises(ObjectError) as caught:
        read_geometry(data, format, Limits())
    assert caught.value.field == "content"
    return caught.value.reason


def test_the_rebuilt_file_reads():
    geometry = read_geometry(_glb(*_parts()), "glb", Limits())
    assert geometry.faces.shape == (72, 3)
    assert (geometry.up, geometry.metres) == ("y", 1.0)


def test_gltf_with_a_data_uri():
    document, binary = _parts()
    document["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    assert len(read_geometry(json.dumps(document).encode(), "gltf", Limits()).faces) == 72


@pytest.mark.parametrize(
    "uri", ["model.bin", "../../etc/passwd", "file:///etc/passwd", "https://example.com/a.bin", ""]
)
def test_external_buffers_are_never_opened(uri):
    document, binary = _parts()
    document["buffers"][0]["uri"] = uri
    assert _refused(_glb(document, binary)) == "OBJECT_EXTERNAL_FILE"
    assert _refused(json.dumps(document).encode(), "gltf") == "OBJECT_EXTERNAL_FILE"


def test_external_images_are_ignored():
    document, binary = _parts()
    document["images"] = [{"uri": "file:///etc/passwd"}]
    document["textures"] = [{"source": 0}]
    document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    document["meshes"][0]["primitives"][0]["material"] = 0
    assert len(read_geometry(_glb(document, binary), "glb", Limits()).faces) == 72


def test_an_unknown_required_extension_is_refused_and_named():
    document, binary = _parts()
    document["extensionsRequired"] = ["ACME_twisted_positions"]
    with pytest.raises(ObjectError) as caught:
        read_geometry(_glb(document, binary), "glb", Limits())
    assert caught.value.reason == "OBJECT_FORMAT_UNSUPPORTED"
    assert "ACME_twisted_positions" in caught.value.message


@pytest.mark.parametrize("extension", ["KHR_materials_sheen", "KHR_texture_transform", "KHR_lights_punctual"])
def test_required_extensions_of_looks_are_no_matter(extension):
    document, binary = _parts()
    document["extensionsRequired"] = [extension]
    assert len(read_geometry(_glb(document, binary), "glb", Limits()).faces) == 72


def test_an_unknown_extension_on_a_mesh_is_told():
    document, binary = _parts()
    document["extensionsUsed"] = ["ACME_twisted_positions"]
    document["meshes"][0]["primitives"][0]["extensions"] = {"ACME_twisted_positions": {}}
    geometry = read_geometry(_glb(document, binary), "glb", Limits())
    assert [note.reason for note in geometry.notes] == ["OBJECT_PART_IGNORED"]


def test_every_truncation_is_refused():
    data = _glb(*_parts())
    for length in [1, 4, 11, 12, 19, 20, 100, *range(len(data) // 2, len(data), 97), len(data) - 1]:
        assert _refused(data[:length]) in ("OBJECT_MALFORMED", "OBJECT_EMPTY")


def test_deep_json():
    assert _refused(_glb(b'{"extras":' + b"[" * 100_000 + b"]" * 100_000 + b"}", b"")) == "OBJECT_MALFORMED"
    assert _refused(b'{"a":' * 50_000, "gltf") == "OBJECT_MALFORMED"


def test_brackets_in_names_are_not_depth():
    document, binary = _parts()
    document["extras"] = [f'part [{index} of {{"chair\\' for index in range(200)]
    assert len(read_geometry(_glb(document, binary), "glb", Limits()).faces) == 72


@pytest.mark.parametrize(
    "text",
    [
        b"[]",
        b"{",
        b"null",
        b'{"accessors": 5}',
        b'{"meshes": [{"primitives": 1}]}',
        b'{"accessors": [{"count": 1e999}]}',
        b"\xff\xfe{}",
    ],
)
def test_json_of_the_wrong_kind(text):
    assert _refused(_glb(text, b"")) in ("OBJECT_MALFORMED", "OBJECT_EMPTY")


def test_accessors_that_promise_a_billion():
    for with_view in (True, False):
        document, binary = _parts()
        for accessor in document["accessors"]:
            accessor["count"] = 10**9
            if not with_view:
                accessor.pop("bufferView", None)
        assert _refused(_glb(document, binary)) in ("OBJECT_MALFORMED", "OBJECT_TOO_COMPLEX")


def test_a_small_file_that_unfolds_to_a_huge_scene():
    document, binary = _parts()
    mesh_node = next(index for index, node in enumerate(document["nodes"]) if "mesh" in node)
    document["nodes"] += [{"mesh": document["nodes"][mesh_node]["mesh"]} for _ in range(4_000)]
    document["scenes"][0]["nodes"] = list(range(len(document["nodes"])))
    document["accessors"][0]["count"] = document["accessors"][0]["count"] // 3 * 3
    limits = Limits(faces=100_000)
    with pytest.raises(ObjectError) as caught:
        read_geometry(_glb(document, binary), "glb", limits)
    assert caught.value.reason == "OBJECT_TOO_COMPLEX"


@pytest.mark.parametrize("cycle", [[0], [1, 0]])
def test_nodes_in_a_circle_end(cycle):
    document, binary = _parts()
    document["nodes"][0].setdefault("children", []).extend(cycle)
    try:
        faces = len(read_geometry(_glb(document, binary), "glb", Limits()).faces)
    except ObjectError as error:
        faces = error.reason
    assert faces in (72, "OBJECT_MALFORMED")


def test_quantized_positions():
    """KHR_mesh_quantization, as mesh optimisers write: normalised 16-bit integers, the node scales them back."""
    mesh = box_chair()
    scale = np.abs(mesh.vertices).max()
    packed = np.zeros((len(mesh.vertices), 4), dtype="<i2")
    packed[:, :3] = np.round(mesh.vertices / scale * 32767)
    indices = mesh.faces.astype("<u2").tobytes()
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [float(scale)] * 3}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5122, "normalized": True, "count": len(packed), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": mesh.faces.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": packed.nbytes, "byteStride": 8},
            {"buffer": 0, "byteOffset": packed.nbytes, "byteLength": len(indices)},
        ],
        "buffers": [{"byteLength": packed.nbytes + len(indices)}],
    }
    geometry = read_geometry(_glb(document, packed.tobytes() + indices), "glb", Limits())
    bounds = [geometry.vertices.min(axis=0), geometry.vertices.max(axis=0)]
    np.testing.assert_allclose(bounds, mesh.bounds, atol=1e-4)


def test_points_as_gltf():
    cloud = trimesh.Scene([trimesh.PointCloud(np.random.default_rng(0).uniform(0, 1, (500, 3)))])
    geometry = read_geometry(cloud.export(file_type="glb"), "glb", Limits())
    assert geometry.faces is None
    assert geometry.vertices.shape == (500, 3)
    assert geometry.up == "y"
