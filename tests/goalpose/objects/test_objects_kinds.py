"""Files of kinds that programs really write and readers get wrong, all of one box chair: each must read as it is."""

import io
import json
import struct
import zipfile

import numpy as np
import pytest
import trimesh
from box_furniture import box, box_chair, chair_parts
from roam_goalpose.objects import ObjectError, load_shape

CHAIR = box_chair()
BOUNDS = np.array([[-0.24, 0.0, -0.24], [0.24, 0.92, 0.24]])
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def _corners(part):
    low, high = part.bounds
    return [[(low, high)[x][0], (low, high)[y][1], (low, high)[z][2]] for x in (0, 1) for y in (0, 1) for z in (0, 1)]


def _is_the_chair(data, format, atol=1e-4, **said):
    shape = load_shape(data if isinstance(data, bytes) else data.encode(), format, **said)
    np.testing.assert_allclose(shape.bounds, BOUNDS, atol=atol)
    assert shape.front[2] > 0.5
    return shape


# ---- OBJ


def _obj(vertex="v {} {} {}", face="f {}", relative=False, header=""):
    lines, start = [header] if header else [], 1
    for part in chair_parts():
        lines += [vertex.format(*corner) for corner in _corners(part)]
        for quad in QUADS:
            lines.append(face.format(" ".join(str(k - 8 if relative else start + k) for k in quad)))
        start += 8
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    "text",
    [
        _obj(relative=True),
        _obj(vertex="v\t{}\t{}\t{}"),
        _obj(vertex="  v   {} {} {}  # corner", face="f {} # side"),
        _obj(header="\ufeff# made by a program"),
        _obj(vertex="v {} {} {} 0.5 0.5 0.5"),
        _obj(vertex="v {} \\\n {} {}"),
        _obj().replace("\n", "\r\n"),
        _obj(header="mtllib not there.mtl\nusemtl wood with spaces"),
    ],
    ids=["relative", "tabs", "comments", "byte-order mark", "colours", "continued", "CRLF", "no materials"],
)
def test_obj(text):
    _is_the_chair(text, "obj")


def test_concave_polygons_are_not_filled_across():
    """An L of 0.46 x 0.46 m with legs 4 cm wide, extruded: an area that a fan would not have."""
    outline = [(0, 0), (0.46, 0), (0.46, 0.04), (0.04, 0.04), (0.04, 0.46), (0, 0.46)]
    text = "".join(f"v {x} {y} {z}\n" for z in (0, 0.46) for x, y in outline)
    text += "f 6 5 4 3 2 1\nf 7 8 9 10 11 12\n"
    text += "".join(f"f {k + 1} {(k + 1) % 6 + 1} {(k + 1) % 6 + 7} {k + 7}\n" for k in range(6))
    shape = load_shape(text.encode(), "obj", unit="m", up="y")
    vertices, faces = shape.mesh
    corners = vertices[faces].astype(np.float64)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    level = np.ptp(corners[:, :, 2], axis=1) < 1e-6
    assert area[level].sum() == pytest.approx(2 * (0.46 * 0.04 + 0.42 * 0.04), abs=1e-5)


# ---- PLY, PCD, STL, XYZ


def _ply_mixed(order="<"):
    vertices = np.array([corner for part in chair_parts() for corner in _corners(part)], order + "f4")
    body, count = vertices.tobytes(), 0
    for part in range(len(chair_parts())):
        for k, (a, b, c, d) in enumerate(QUADS):
            polygons = [(a, b, c), (a, c, d)] if k % 2 else [(a, b, c, d)]
            for polygon in polygons:
                body += struct.pack(f"{order}B{len(polygon)}i", len(polygon), *(8 * part + p for p in polygon))
                count += 1
    kind = "binary_little_endian" if order == "<" else "binary_big_endian"
    head = f"ply\nformat {kind} 1.0\ncomment x\nelement vertex {len(vertices)}\n"
    head += "property float x\nproperty float y\nproperty float z\n"
    head += f"element face {count}\nproperty list uchar int vertex_index\nend_header\n"
    return head.encode() + body


@pytest.mark.parametrize("order", ["<", ">"])
def test_ply_of_triangles_and_quads(order):
    _is_the_chair(_ply_mixed(order), "ply")


def _cloud(count=8000):
    return trimesh.sample.sample_surface(CHAIR, count, seed=1)[0]


def test_returns_without_a_place_are_left_out_and_said():
    points = _cloud()
    points[::9] = np.nan
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "property double x\nproperty double y\nproperty double z\nend_header\n"
    shape = _is_the_chair(head.encode() + points.astype("<f8").tobytes(), "ply", atol=0.02)
    assert any("889 points" in warning.message for warning in shape.warnings)


def test_an_organised_pcd_without_a_points_line():
    head = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 100\nHEIGHT 80\nDATA binary\n"
    shape = _is_the_chair(head.encode() + _cloud().astype("<f4").tobytes(), "pcd", atol=0.02)
    assert len(shape.points) == 8000


def _stl(**words):
    text = CHAIR.export(file_type="stl_ascii")
    for old, new in words.items():
        text = text.replace(old, new)
    return text


@pytest.mark.parametrize(
    "data",
    [
        _stl(solid="Solid"),
        _stl().replace("endloop", "end loop").replace("endfacet", "end facet"),
        _stl().upper(),
        b"solid as binary files may begin".ljust(80, b" ") + CHAIR.export(file_type="stl")[80:],
    ],
    ids=["Solid", "end loop", "upper case", "binary that begins with solid"],
)
def test_stl(data):
    _is_the_chair(data, "stl")


def _rows(points, line="{:.6f} {:.6f} {:.6f}"):
    return "\n".join(line.format(*point) for point in points)


@pytest.mark.parametrize(
    "text",
    [
        "X Y Z R G B\n" + _rows(_cloud(), "{:.6f} {:.6f} {:.6f} 1 2 3"),
        "8000\n" + _rows(_cloud(), "{:.6f} {:.6f} {:.6f} -1200 10 20 30"),
        "intensity,z,y,x\n" + "\n".join(f"7,{z:.6f},{y:.6f},{x:.6f}" for x, y, z in _cloud()),
        "# exported\n//X;Y;Z\n" + _rows(_cloud(), "{:.6f};{:.6f};{:.6f}"),
        _rows(_cloud(), "{:.6f} {:.6f} {:.6f}").replace(".", ",").replace(" ", ";"),
    ],
    ids=["column names", "PTS", "CSV in another order", "comments", "decimal commas"],
)
def test_point_text(text):
    _is_the_chair(text, "xyz", atol=0.02)


# ---- glTF


def glb(document, binary):
    text = json.dumps({"asset": {"version": "2.0"}, "scene": 0, **document}).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


class Buffer:
    """Accessors one after another."""

    def __init__(self):
        self.binary, self.views, self.accessors = b"", [], []

    def add(self, array, kind, component=5126, **more):
        data = np.ascontiguousarray(array).tobytes()
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)})
        self.binary += data
        self.accessors.append(
            {"bufferView": len(self.views) - 1, "componentType": component, "count": len(array), "type": kind, **more}
        )
        return len(self.accessors) - 1

    def glb(self, **document):
        parts = {"buffers": [{"byteLength": len(self.binary)}], "bufferViews": self.views, "accessors": self.accessors}
        return glb({**parts, "scenes": [{"nodes": list(range(len(document["nodes"])))}], **document}, self.binary)

    def mesh(self, vertices=None, faces=None, **primitive):
        position = self.add(np.asarray(CHAIR.vertices if vertices is None else vertices, "<f4"), "VEC3")
        index = self.add(np.asarray(CHAIR.faces if faces is None else faces, "<u4").ravel(), "SCALAR", 5125)
        return {"attributes": {"POSITION": position, **primitive.pop("attributes", {})}, "indices": index, **primitive}


def test_default_morph_weights_are_applied():
    buffer, flat = Buffer(), CHAIR.vertices.copy()
    raised = flat[:, 1] > 0.5
    flat[raised, 1] = 0.47
    moves = np.zeros_like(flat)
    moves[raised, 1] = 0.45
    primitive = buffer.mesh(flat)
    primitive["targets"] = [{"POSITION": buffer.add(moves.astype("<f4"), "VEC3")}]
    _is_the_chair(buffer.glb(nodes=[{"mesh": 0}], meshes=[{"primitives": [primitive], "weights": [1.0]}]), "glb")
    on_node = [{"mesh": 0, "weights": [1.0]}]
    _is_the_chair(buffer.glb(nodes=on_node, meshes=[{"primitives": [primitive], "weights": [0.0]}]), "glb")


def test_sparse_accessors():
    buffer, flat = Buffer(), CHAIR.vertices.astype("<f4")
    raised = np.flatnonzero(flat[:, 1] > 0.5)
    low = flat.copy()
    low[raised, 1] = 0.47
    primitive = buffer.mesh(low)
    rows = buffer.add(raised.astype("<u2"), "SCALAR", 5123)
    values = buffer.add(flat[raised], "VEC3")
    buffer.accessors[0]["sparse"] = {
        "count": len(raised),
        "indices": {"bufferView": buffer.accessors[rows]["bufferView"], "componentType": 5123},
        "values": {"bufferView": buffer.accessors[values]["bufferView"]},
    }
    _is_the_chair(buffer.glb(nodes=[{"mesh": 0}], meshes=[{"primitives": [primitive]}]), "glb")


@pytest.mark.parametrize("node", [{}, {"scale": [5, 5, 5]}, {"translation": [3, 0, 0], "rotation": [0, 1, 0, 0]}])
def test_a_skinned_mesh_stands_where_its_joints_hold_it(node):
    buffer = Buffer()
    lying = 100 * CHAIR.vertices[:, [0, 2, 1]] * [1, -1, 1]  # centimetres, Z up
    count = len(lying)
    bind = np.eye(4)
    bind[:3, :3] = 0.01 * np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    primitive = buffer.mesh(lying)
    primitive["attributes"]["JOINTS_0"] = buffer.add(np.zeros((count, 4), "u1"), "VEC4", 5121)
    primitive["attributes"]["WEIGHTS_0"] = buffer.add(np.tile([1, 0, 0, 0], (count, 1)).astype("<f4"), "VEC4")
    matrix = buffer.add(bind.T.reshape(1, 16).astype("<f4"), "MAT4")
    nodes = [{"name": "joint"}, {"mesh": 0, "skin": 0, **node}]
    skins = [{"joints": [0], "inverseBindMatrices": matrix}]
    _is_the_chair(buffer.glb(nodes=nodes, meshes=[{"primitives": [primitive]}], skins=skins), "glb")


def test_gpu_instancing_places_every_leg():
    seat, back, *legs = chair_parts()
    buffer = Buffer()
    top = trimesh.util.concatenate([seat, back])
    leg = legs[0].copy()
    leg.apply_translation([0.22, 0, 0.22])
    meshes = [{"primitives": [buffer.mesh(top.vertices, top.faces)]}]
    meshes += [{"primitives": [buffer.mesh(leg.vertices, leg.faces)]}]
    places = np.array([(x, 0, z) for x in (-0.22, 0.18) for z in (-0.22, 0.18)], "<f4")
    attributes = {"TRANSLATION": buffer.add(places, "VEC3")}
    nodes = [{"mesh": 0}, {"mesh": 1, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}]
    used = ["EXT_mesh_gpu_instancing"]
    shape = _is_the_chair(buffer.glb(nodes=nodes, meshes=meshes, extensionsRequired=used, extensionsUsed=used), "glb")
    assert len(shape.mesh[1]) == 72


def test_one_instance_with_a_scale():
    buffer = Buffer()
    primitive = buffer.mesh(1000 * CHAIR.vertices)
    attributes = {
        "TRANSLATION": buffer.add(np.array([[0.8, 0, 0.5]], "<f4"), "VEC3"),
        "SCALE": buffer.add(np.full((1, 3), 0.001, "<f4"), "VEC3"),
    }
    nodes = [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}]
    shape = load_shape(buffer.glb(nodes=nodes, meshes=[{"primitives": [primitive]}]), "glb")
    np.testing.assert_allclose(shape.bounds, BOUNDS + np.array([0.8, 0, 0.5]), atol=1e-4)


@pytest.mark.parametrize(("mode", "order"), [(6, (0, 1, 2, 3)), (5, (0, 1, 3, 2))], ids=["fan", "strip"])
def test_fans_and_strips(mode, order):
    buffer, primitives = Buffer(), []
    for part in chair_parts():
        corners = np.array(_corners(part), "<f4")
        for quad in QUADS:
            position = buffer.add(corners[[quad[k] for k in order]], "VEC3")
            primitives.append({"attributes": {"POSITION": position}, "mode": mode})
    _is_the_chair(buffer.glb(nodes=[{"mesh": 0}], meshes=[{"primitives": primitives}]), "glb")


def test_draco():
    draco = pytest.importorskip("DracoPy")
    packed = draco.encode(CHAIR.vertices.astype(np.float32), CHAIR.faces.astype(np.uint32), quantization_bits=16)
    extension = {"bufferView": 0, "attributes": {"POSITION": 0}}
    document = {
        "extensionsRequired": ["KHR_draco_mesh_compression"],
        "buffers": [{"byteLength": len(packed)}],
        "bufferViews": [{"buffer": 0, "byteLength": len(packed)}],
        "accessors": [
            {"componentType": 5126, "count": len(CHAIR.vertices), "type": "VEC3"},
            {"componentType": 5125, "count": CHAIR.faces.size, "type": "SCALAR"},
        ],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 0},
                        "indices": 1,
                        "extensions": {"KHR_draco_mesh_compression": extension},
                    }
                ]
            }
        ],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    _is_the_chair(glb(document, packed), "glb", atol=1e-3)


def test_meshopt():
    meshopt = pytest.importorskip("meshoptimizer")
    vertices = np.ascontiguousarray(CHAIR.vertices, np.float32)
    indices = np.ascontiguousarray(CHAIR.faces, np.uint32).ravel()
    packed = bytes(meshopt.encode_vertex_buffer(vertices, len(vertices), 12))
    padding = b"\0" * (-len(packed) % 4)
    index = bytes(meshopt.encode_index_buffer(indices, len(indices), len(vertices)))
    binary = packed + padding + index
    views = [(0, packed, len(vertices), 12, "ATTRIBUTES"), (len(packed + padding), index, len(indices), 2, "TRIANGLES")]
    document = {
        "extensionsRequired": ["EXT_meshopt_compression"],
        "buffers": [
            {"byteLength": len(binary)},
            {"byteLength": 100_000, "extensions": {"EXT_meshopt_compression": {"fallback": True}}},
        ],
        "bufferViews": [
            {
                "buffer": 1,
                "byteLength": count * stride,
                "extensions": {
                    "EXT_meshopt_compression": {
                        "buffer": 0,
                        "byteOffset": at,
                        "byteLength": len(data),
                        "byteStride": stride,
                        "count": count,
                        "mode": mode,
                    }
                },
            }
            for at, data, count, stride, mode in views
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": len(indices), "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    _is_the_chair(glb(document, binary), "glb")


# ---- sizes, scans, scenes


def _grounded(mesh):
    mesh.apply_translation([0, -mesh.bounds[0, 1], 0])
    return mesh


def test_a_room_is_refused_in_metres_and_says_why():
    room = trimesh.Scene(
        {"seat": CHAIR, "floor": box((-5, -0.05, -5), (5, 0, 5)), "wall": box((-5, 0, -5.1), (5, 2.5, -5))}
    )
    with pytest.raises(ObjectError) as caught:
        load_shape(room.export(file_type="glb"), "glb")
    assert caught.value.reason == "OBJECT_SIZE_IMPLAUSIBLE"
    assert "10.1 m" in caught.value.message


def test_a_mat_is_read_as_it_is():
    shape = load_shape(box((-1, 0, -0.4), (1, 0.09, 0.4)).export(file_type="glb"), "glb")
    np.testing.assert_allclose(np.ptp(shape.bounds, axis=0), [2.0, 0.09, 0.8], atol=1e-4)


def _set():
    """A table and four chairs around it, each facing it."""
    parts = {
        "table": trimesh.util.concatenate(
            [
                box((-0.6, 0.7, -0.4), (0.6, 0.75, 0.4)),
                *[box((x, 0, z), (x + 0.05, 0.7, z + 0.05)) for x in (-0.55, 0.5) for z in (-0.35, 0.3)],
            ]
        )
    }
    for name, turn, place in (
        ("north", 0, (0, 0, -0.9)),
        ("south", np.pi, (0, 0, 0.9)),
        ("west", np.pi / 2, (-1.1, 0, 0)),
        ("east", -np.pi / 2, (1.1, 0, 0)),
    ):
        chair = box_chair()
        chair.apply_transform(trimesh.transformations.rotation_matrix(turn, [0, 1, 0]))
        chair.apply_translation(place)
        parts[name] = chair
    return trimesh.Scene(parts).export(file_type="glb")


def test_a_set_gives_a_chair_with_its_own_front():
    shape = load_shape(_set(), "glb")
    assert "OBJECT_PIECE_CHOSEN" in [warning.reason for warning in shape.warnings]
    assert len(shape.pieces) == 5
    assert np.ptp(shape.bounds[:, 1]) == pytest.approx(0.92, abs=1e-3)
    towards = -shape.bounds.mean(axis=0) * [1, 0, 1]
    assert shape.front @ towards / np.linalg.norm(towards) > 0.95


@pytest.mark.parametrize(("piece", "middle"), [("west", (-1.1, 0)), ("EAST", (1.1, 0)), ("2", (0, 0.9))])
def test_a_piece_by_name_or_index(piece, middle):
    shape = load_shape(_set(), "glb", piece=piece)
    np.testing.assert_allclose(shape.bounds.mean(axis=0)[[0, 2]], middle, atol=1e-3)


def test_a_piece_that_is_not_there_is_refused_with_the_list():
    with pytest.raises(ObjectError) as caught:
        load_shape(_set(), "glb", piece="sofa")
    assert (caught.value.reason, caught.value.field) == ("OBJECT_PIECE_UNKNOWN", "piece")
    assert "north" in caught.value.message


@pytest.mark.parametrize("around", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("up", ["y", "z"])
def test_a_floor_under_a_scan_is_cut_off(around, up):
    rng, reach = np.random.default_rng(3), 0.24 + around
    count = int(12_000 * (2 * reach) ** 2 / CHAIR.area)
    floor = np.stack(
        [rng.uniform(-reach, reach, count), rng.normal(0, 0.003, count), rng.uniform(-reach, reach, count)], 1
    )
    points = np.concatenate([_cloud(12_000), floor])
    shape = load_shape(_rows(points if up == "y" else points[:, [0, 2, 1]] * [1, -1, 1]).encode(), "xyz")
    assert "OBJECT_FLOOR_CUT" in [warning.reason for warning in shape.warnings]
    assert np.ptp(shape.bounds[:, 1]) == pytest.approx(0.92, abs=0.03)
    assert np.ptp(shape.bounds[:, 0]) == pytest.approx(0.48, abs=0.03)
    assert shape.floor_height == pytest.approx(0.0, abs=0.01)


def test_a_floor_of_one_quad_under_a_mesh_is_cut_off():
    quad = trimesh.Trimesh([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], [[0, 2, 1], [0, 3, 2]], process=False)
    shape = _is_the_chair(trimesh.util.concatenate([CHAIR, quad]).export(file_type="obj"), "obj")
    assert "OBJECT_FLOOR_CUT" in [warning.reason for warning in shape.warnings]


@pytest.mark.parametrize("away", [2.0, 10.0, 20.0])
def test_a_stray_point_changes_nothing(away):
    points = np.concatenate([_cloud(), [[away, 1, 2], [-away, 0.5, 1]]])
    shape = _is_the_chair(_rows(points), "xyz", atol=0.02)
    assert any("2 stray points" in warning.message for warning in shape.warnings)


@pytest.mark.parametrize(("scale", "name"), [(1.0, "m"), (100.0, "cm"), (1000.0, "mm"), (1 / 0.0254, "in")])
def test_units_by_what_a_body_can_use(scale, name):
    for mesh in (box_chair(), box((-0.9, 0, -0.2), (0.9, 0.45, 0.2))):
        mesh.apply_scale(scale)
        shape = load_shape(mesh.export(file_type="stl"), "stl", up="y")
        height = np.ptp(shape.bounds[:, 1])
        assert 0.4 < height < 0.95, name


def test_a_height_that_is_given_is_obeyed():
    for unit in (None, "cm"):
        shape = load_shape(CHAIR.export(file_type="obj").encode(), "obj", unit=unit, size=1.1)
        assert np.ptp(shape.bounds[:, 1]) == pytest.approx(1.1, abs=1e-6)


# ---- archives


def _zip(**files):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name.replace("__", "/").replace("_dot_", "."), content)
    return packed.getvalue()


def test_a_gltf_with_its_buffer_in_a_zip():
    files = trimesh.exchange.gltf.export_gltf(trimesh.Scene([CHAIR]))
    packed = _zip(**{f"chair__{name}": content for name, content in files.items()})
    _is_the_chair(packed, "zip")


def test_an_obj_with_materials_in_a_zip():
    packed = _zip(chair_dot_obj=_obj(header="mtllib chair.mtl"), chair_dot_mtl="newmtl wood", readme_dot_txt="hello")
    _is_the_chair(packed, "zip")
    _is_the_chair(packed.replace(b"readme.txt", b"\0" * 10), "zip")  # a damaged name: passed over


@pytest.mark.parametrize(
    ("packed", "words"),
    [(_zip(a_dot_obj=_obj(), b_dot_obj=_obj()), "2 objects"), (_zip(letter_dot_doc="hello"), "no ")],
)
def test_a_zip_of_two_objects_or_none_is_refused(packed, words):
    with pytest.raises(ObjectError, match=words):
        load_shape(packed, "zip")


def test_a_zip_bomb_is_refused():
    with pytest.raises(ObjectError) as caught:
        load_shape(_zip(bomb_dot_obj=b"v 0 0 0\n" * 80_000_000), "zip")
    assert caught.value.reason == "OBJECT_TOO_LARGE"
