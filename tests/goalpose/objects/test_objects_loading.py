import io
import struct

import numpy as np
import pytest
import trimesh
from box_furniture import box_chair, box_sofa, chair_parts
from roam_goalpose.objects import ObjectError, format_of, load_shape

Z_UP = trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])  # +Y up → +Z up


@pytest.fixture
def chair():
    return box_chair()


@pytest.fixture
def cloud(chair):
    """6,000 points on the chair."""
    return np.asarray(trimesh.sample.sample_surface(chair, 6000, seed=1)[0])


def _bytes(content):
    return content.encode() if isinstance(content, str) else content


def _chair_bounds():
    return np.array([[-0.24, 0.0, -0.24], [0.24, 0.92, 0.24]])


@pytest.mark.parametrize("format", ["obj", "glb", "ply", "stl", "off"])
def test_a_mesh_comes_back_in_place_from_every_format(chair, format):
    shape = load_shape(_bytes(chair.export(file_type=format)), format)
    np.testing.assert_allclose(shape.bounds, _chair_bounds(), atol=1e-6)
    assert shape.points.shape == (20_000, 3)
    assert shape.points.dtype == np.float32
    assert shape.normals is not None
    np.testing.assert_allclose(np.linalg.norm(shape.normals, axis=1), 1.0, atol=1e-5)
    np.testing.assert_array_equal(shape.object_to_world, np.eye(4))
    assert shape.mesh is not None
    assert len(shape.mesh[1]) == 6 * 12
    assert shape.warnings == ()


def test_text_variants_of_ply_and_stl(chair):
    ply = load_shape(chair.export(file_type="ply", encoding="ascii"), "ply")
    stl = load_shape(chair.export(file_type="stl_ascii").encode(), "stl")
    np.testing.assert_allclose(ply.bounds, _chair_bounds(), atol=1e-5)
    np.testing.assert_allclose(stl.bounds, _chair_bounds(), atol=1e-5)


def test_gltf_with_embedded_buffers(chair):
    files = trimesh.exchange.gltf.export_gltf(trimesh.Scene([chair]), embed_buffers=True)
    shape = load_shape(files["model.gltf"], "gltf")
    np.testing.assert_allclose(shape.bounds, _chair_bounds(), atol=1e-6)


def test_point_cloud_formats_agree(cloud):
    npy = io.BytesIO()
    np.save(npy, cloud.astype(np.float32))
    text = "\n".join(f"{x:.6f} {y:.6f} {z:.6f} 0 255 0" for x, y, z in cloud).encode()
    ply = trimesh.PointCloud(cloud).export(file_type="ply")
    for data, format in ((npy.getvalue(), "npy"), (text, "xyz"), (ply, "ply")):
        shape = load_shape(data, format)
        assert shape.normals is None
        assert shape.mesh is None
        assert shape.points.shape == (6000, 3)
        np.testing.assert_allclose(shape.bounds, [cloud.min(axis=0), cloud.max(axis=0)], atol=1e-5)


@pytest.mark.parametrize("text", ["6000\n", "# made by a scanner\n", "// x,y,z\n", "\ufeff"])
def test_xyz_headers_and_separators(cloud, text):
    rows = (text + "\n".join(f"{x:.6f}, {y:.6f}; {z:.6f}" for x, y, z in cloud)).encode()
    assert len(load_shape(rows, "xyz").points) == 6000


@pytest.mark.parametrize("dtype", ["<f4", "<f8", ">f4", "<f2"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_npy_number_types_and_orders(cloud, dtype, order):
    stream = io.BytesIO()
    np.save(stream, np.asarray(cloud.astype(dtype), order=order))
    shape = load_shape(stream.getvalue(), "npy", unit="m", up="y")
    np.testing.assert_allclose(shape.bounds[1], [0.24, 0.92, 0.24], atol=2e-3)


def test_sub_meshes_are_placed_by_their_nodes():
    scene = trimesh.Scene()
    for index, part in enumerate(chair_parts()):
        # Every part is stored away from its place, inside a turned and scaled parent.
        transform = trimesh.transformations.rotation_matrix(0.3 * index, [0, 1, 0], [0.1, 0, 0])
        transform[:3, :3] *= 2.0
        stored = part.copy().apply_transform(np.linalg.inv(transform))
        scene.add_geometry(stored, node_name=f"part{index}", transform=transform)
    shape = load_shape(scene.export(file_type="glb"), "glb")
    np.testing.assert_allclose(shape.bounds, _chair_bounds(), atol=1e-6)


def test_a_mirrored_instance_keeps_its_faces_outward(chair):
    scene = trimesh.Scene()
    scene.add_geometry(chair, transform=np.diag([-1.0, 1.0, 1.0, 1.0]))
    shape = load_shape(scene.export(file_type="glb"), "glb")
    mesh = trimesh.Trimesh(*shape.mesh, process=False)
    assert mesh.volume == pytest.approx(chair.volume, rel=1e-4)


def test_materials_and_images_are_ignored(chair):
    chair.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(chair.vertices), 2)))
    text = "mtllib ../../secret.mtl\nusemtl wood\n" + chair.export(file_type="obj", include_texture=False)
    np.testing.assert_allclose(load_shape(text.encode(), "obj").bounds, _chair_bounds(), atol=1e-6)


def test_quads_and_polygons_of_an_obj():
    corners = [(x, y, z) for x in (0, 0.5) for y in (0, 0.45) for z in (0, 0.5)]
    quads = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {quad}\n" for quad in quads)
    shape = load_shape(text.encode(), "obj", up="y")
    np.testing.assert_allclose(shape.bounds[1], [0.5, 0.45, 0.5])
    assert len(shape.mesh[1]) == 12


@pytest.mark.parametrize(("unit", "metres"), [("cm", 0.01), ("mm", 0.001), ("inch", 0.0254), ("ft", 0.3048)])
def test_a_given_unit_scales_the_object(chair, unit, metres):
    chair.apply_scale(1 / metres)
    shape = load_shape(chair.export(file_type="obj").encode(), "obj", unit=unit)
    np.testing.assert_allclose(shape.bounds, _chair_bounds(), atol=1e-6)
    np.testing.assert_allclose(shape.object_to_world, np.diag([metres, metres, metres, 1.0]))


@pytest.mark.parametrize("up", ["y", "z", "x", "-y", "-z", "-x", "+Z"])
def test_a_given_up_axis_turns_the_object_without_mirroring(chair, up):
    shape = load_shape(chair.export(file_type="stl"), "stl", up=up)
    linear = shape.object_to_world[:3, :3]
    assert np.linalg.det(linear) == pytest.approx(1.0)
    axis = np.eye(3)["xyz".index(up.lower()[-1])] * (-1 if up.startswith("-") else 1)
    np.testing.assert_allclose(linear @ axis, [0, 1, 0])
    vertices = chair.vertices @ linear.T
    np.testing.assert_allclose(shape.bounds, [vertices.min(axis=0), vertices.max(axis=0)], atol=1e-6)
    assert shape.floor_height == pytest.approx(vertices[:, 1].min(), abs=1e-6)


def test_z_up_follows_the_usual_convention(chair):
    shape = load_shape(chair.export(file_type="obj").encode(), "obj", up="z")
    np.testing.assert_array_equal(shape.object_to_world[:3, :3] @ [1, 2, 3], [1, 3, -2])


@pytest.mark.parametrize(("make", "metres"), [(box_chair, 1.0), (box_sofa, 0.01), (box_chair, 0.001)])
def test_unit_and_up_axis_are_found(make, metres):
    moved = make().apply_transform(Z_UP).apply_scale(1 / metres)
    shape = load_shape(moved.export(file_type="stl"), "stl")
    np.testing.assert_allclose(shape.bounds, make().bounds, atol=1e-5)
    np.testing.assert_allclose(shape.object_to_world[:3, :3] @ [0, 0, 1], [0, metres, 0], atol=1e-9)


def test_glb_is_y_up_whatever_it_shows(chair):
    lying = chair.copy().apply_transform(Z_UP)
    shape = load_shape(lying.export(file_type="glb"), "glb")
    np.testing.assert_array_equal(shape.object_to_world, np.eye(4))


def test_the_placement_in_the_file_is_kept(chair):
    chair.apply_translation([3.0, 0.1, -2.0])
    shape = load_shape(chair.export(file_type="glb"), "glb")
    np.testing.assert_allclose(shape.bounds, np.add(_chair_bounds(), [3.0, 0.1, -2.0]), atol=1e-5)
    assert shape.floor_height == pytest.approx(0.1, abs=1e-5)


def test_object_to_world_takes_file_points_to_shape_points(chair):
    chair.apply_transform(Z_UP).apply_scale(100)
    shape = load_shape(chair.export(file_type="ply"), "ply")
    there = np.c_[chair.vertices, np.ones(len(chair.vertices))] @ shape.object_to_world.T
    np.testing.assert_allclose(shape.mesh[0].min(axis=0), there[:, :3].min(axis=0), atol=1e-5)
    np.testing.assert_allclose(shape.mesh[0].max(axis=0), there[:, :3].max(axis=0), atol=1e-5)


def test_same_bytes_same_shape_and_other_bytes_another(chair):
    data = chair.export(file_type="glb")
    first, second = load_shape(data, "glb"), load_shape(data, "glb")
    assert first.name == second.name
    assert first.name.startswith("objects/sha256:")
    np.testing.assert_array_equal(first.points, second.points)
    np.testing.assert_array_equal(first.distance.values, second.distance.values)
    chair.vertices[0] += 0.001
    assert load_shape(chair.export(file_type="glb"), "glb").name != first.name
    assert load_shape(data, "glb", up="z").name != first.name


def test_samples_spread_by_area_from_the_first_on(chair):
    """Every beginning of the samples gives each part its share of the area: a level 19 % of this chair is at 0.47 m."""
    shape = load_shape(chair.export(file_type="glb"), "glb")
    share = (0.48 * 0.48 + 0.48 * 0.04) / chair.area
    for count in (500, 2000, 20_000):
        on_seat = np.abs(shape.points[:count, 1] - 0.47) < 1e-5
        assert on_seat.mean() == pytest.approx(share, abs=3 * np.sqrt(share / count))


def test_dense_clouds_are_thinned_evenly(chair):
    """A scan with a hundred times as many points on the seat as elsewhere keeps its other parts."""
    sparse = np.asarray(trimesh.sample.sample_surface(chair, 20_000, seed=1)[0])
    seat = np.random.default_rng(0).uniform([-0.24, 0.47, -0.24], [0.24, 0.47, 0.24], (150_000, 3))
    stream = io.BytesIO()
    np.save(stream, np.concatenate([sparse, seat]))
    shape = load_shape(stream.getvalue(), "npy")
    assert len(shape.points) == 20_000
    assert (np.abs(shape.points[:2000, 1] - 0.47) < 1e-6).mean() < 0.35


def _refused(reason, field, data, format, **options):
    with pytest.raises(ObjectError) as caught:
        load_shape(data, format, **options)
    assert (caught.value.reason, caught.value.field) == (reason, field)
    assert caught.value.message
    assert caught.value.remedy
    return caught.value


def test_refusals_name_the_field_and_what_to_do(chair):
    data = chair.export(file_type="obj").encode()
    assert "obj" in _refused("OBJECT_FORMAT_UNKNOWN", "format", data, "object").remedy
    assert "glTF" in _refused("OBJECT_FORMAT_UNSUPPORTED", "format", data, "step").remedy
    assert "mm" in _refused("OBJECT_UNIT_UNKNOWN", "unit", data, "obj", unit="parsec").remedy
    assert "-z" in _refused("OBJECT_UP_UNKNOWN", "up", data, "obj", up="w").remedy
    assert "9.2" in _refused("OBJECT_SIZE_IMPLAUSIBLE", "unit", data.replace(b"0.92", b"9.2"), "obj", unit="m").message
    glb = chair.export(file_type="glb")
    assert "'glb'" in _refused("OBJECT_FORMAT_MISMATCH", "format", glb, "obj").remedy


def test_empty_files(chair):
    _refused("OBJECT_EMPTY", "content", b"", "obj")
    _refused("OBJECT_EMPTY", "content", b"# nothing\n", "obj")
    flat = b"v 0 0 0\nv 1 0 0\nv 0 1 1\nv 1 1 1\nf 1 2 2\nf 3 4 4\nf 1 1 4\n"
    _refused("OBJECT_EMPTY", "content", flat, "obj")


def test_sheets_lines_and_distant_objects(chair):
    sheet = trimesh.creation.box((0.5, 0.001, 0.5))
    _refused("OBJECT_TOO_FLAT", "content", sheet.export(file_type="stl"), "stl")
    chair.apply_translation([0, 0, 5000])
    _refused("OBJECT_FAR_AWAY", "content", chair.export(file_type="obj").encode(), "obj")


@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "1e30", "1e300"])
def test_coordinates_that_are_not_finite(chair, number):
    text = chair.export(file_type="obj").replace("0.92", number, 1).encode()
    _refused("OBJECT_NOT_FINITE", "content", text, "obj")


def test_stray_vertices_that_no_face_uses_do_not_matter(chair):
    text = "v 1e9 nan 5\n" + chair.export(file_type="obj")
    shifted = "\n".join(
        "f " + " ".join(str(int(word.split("/")[0]) + 1) for word in line.split()[1:])
        if line.startswith("f ")
        else line
        for line in text.splitlines()
    )
    np.testing.assert_allclose(load_shape(shifted.encode(), "obj").bounds, _chair_bounds(), atol=1e-6)


def test_too_few_points():
    _refused("OBJECT_TOO_FEW_POINTS", "content", b"0 0 0\n1 0 0\n0 1 1\n", "xyz")


def test_pickled_arrays_are_never_loaded():
    stream = io.BytesIO()
    np.save(stream, np.array([[print, 1, 2]], dtype=object), allow_pickle=True)
    assert "pickled" in _refused("OBJECT_MALFORMED", "content", stream.getvalue(), "npy").message


@pytest.mark.parametrize("shape", [(-1, 3), (3, -1), (300,), (300, 2), (300, 3, 1), ()])
def test_arrays_of_another_shape(shape):
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f4", "fortran_order": False, "shape": shape})
    _refused("OBJECT_MALFORMED", "content", stream.getvalue() + bytes(3600), "npy")


def test_headers_that_promise_a_billion():
    npy = io.BytesIO()
    np.lib.format.write_array_header_1_0(npy, {"descr": "<f4", "fortran_order": False, "shape": (10**9, 3)})
    _refused("OBJECT_TOO_COMPLEX", "content", npy.getvalue(), "npy")
    stl = bytes(80) + struct.pack("<I", 10**9) + bytes(50)
    _refused("OBJECT_MALFORMED", "content", stl, "stl")
    ply = (
        b"ply\nformat binary_little_endian 1.0\nelement vertex 1000000000\nproperty float x\nproperty float y\n"
        b"property float z\nelement face 1000000000\nproperty list uchar int vertex_indices\nend_header\n" + bytes(64)
    )
    _refused("OBJECT_TOO_COMPLEX", "content", ply, "ply")
    _refused("OBJECT_MALFORMED", "content", ply.replace(b"1000000000", b"1000000"), "ply")
    off = b"OFF\n1000000000 1000000000 0\n0 0 0\n"
    _refused("OBJECT_TOO_COMPLEX", "content", off, "off")


def test_raw_files_as_people_upload_them(objects):
    """Real files in other units and axes: heights as in the catalogue of the set (m)."""
    heights = {
        "office_visitor_chair_cm.obj": 0.82,
        "obj_with_textures/couch/couch.obj": 0.86,
        "obj_with_textures/deckChair/deckChair.obj": 0.84,
        "obj_with_textures/plasticChair/plasticChair.obj": 0.82,
        "pal_bench_m_zup.stl": 1.0,
        "pal_sofa_m_zup.stl": 0.9,
        "khronos_wicker_swing_chair.glb": 1.89,
        "kenney_sofa_half_size.glb": 0.46,
        "polyhaven_armchair_oversize.glb": 1.59,
    }
    for name, height in heights.items():
        path = objects / "raw_samples" / name
        shape = load_shape(path.read_bytes(), format_of(path))
        assert shape.bounds[1, 1] - shape.bounds[0, 1] == pytest.approx(height, abs=0.01), name


def test_raw_files_that_say_their_unit_and_axes(objects):
    heights = {"aws_chair_a_cm_zup.dae": 0.91, "aws_sofa_corner_cm_zup.dae": 0.97}
    for name, height in heights.items():
        path = objects / "raw_samples" / name
        shape = load_shape(path.read_bytes(), format_of(path))
        assert shape.bounds[1, 1] - shape.bounds[0, 1] == pytest.approx(height, abs=0.1), name
