"""GLB files hold a skinned body that an independent reader understands and poses as we do."""

import numpy as np
import pygltflib
from roam_character.figure.person import figure_mesh
from roam_character.formats.glb import glb_bytes, write_glb


def accessor(gltf, index):
    """An accessor as an array, read by its declared type."""
    item = gltf.accessors[index]
    view = gltf.bufferViews[item.bufferView]
    code = {5126: "<f4", 5125: "<u4", 5123: "<u2", 5121: "<u1"}[item.componentType]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[item.type]
    data = gltf.binary_blob()[view.byteOffset :]
    return np.frombuffer(data, code, item.count * width).reshape(item.count, width)


def test_motion_has_a_track_for_every_joint(clip, tmp_path):
    write_glb(tmp_path / "a.glb", clip)
    gltf = pygltflib.GLTF2().load(str(tmp_path / "a.glb"))
    channels = gltf.animations[0].channels
    assert len(channels) == clip.skeleton.joint_count + 1
    track = {(c.target.node, c.target.path): gltf.animations[0].samplers[c.sampler].output for c in channels}
    assert np.allclose(accessor(gltf, track[0, "translation"]), clip.root_positions)
    assert np.allclose(accessor(gltf, track[3, "rotation"]), clip.rotations[:, 3])


def test_skinning_by_the_file_gives_our_posed_body(clip):
    gltf = pygltflib.GLTF2.load_from_bytes(glb_bytes(clip.pose(7)))
    inverse = accessor(gltf, gltf.skins[0].inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    attributes = gltf.meshes[0].primitives[0].attributes
    vertices, joints = accessor(gltf, attributes.POSITION), accessor(gltf, attributes.JOINTS_0)
    weights = accessor(gltf, attributes.WEIGHTS_0)
    world = {}
    for index, node in enumerate(gltf.nodes[: clip.skeleton.joint_count]):
        x, y, z, w = node.rotation
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        local = np.block([[turn, np.array(node.translation)[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
        parent = clip.skeleton.parents[index]
        world[index] = local if parent < 0 else world[parent] @ local
    homogeneous = np.concatenate([vertices, np.ones((len(vertices), 1))], axis=1)
    moved = np.stack([world[j] @ inverse[j] for j in range(clip.skeleton.joint_count)])[joints]
    skinned = np.einsum("vk,vkab,vb->va", weights, moved, homogeneous)[:, :3]
    expected = figure_mesh(clip.skeleton).posed(clip.skeleton, *clip.pose(7).posture())
    assert np.allclose(skinned, expected, atol=1e-4)


def test_object_stands_beside_the_body(clip):
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    gltf = pygltflib.GLTF2.load_from_bytes(glb_bytes(clip.pose(0), mesh=(vertices, np.array([[0, 1, 2]]))))
    names = [gltf.nodes[n].name for n in gltf.scenes[0].nodes]
    assert names == ["hips", "body", "object"]
    assert gltf.animations == []


def test_body_normals_point_outwards(clip):
    body = figure_mesh(clip.skeleton)
    faces = np.concatenate([surface.faces for surface in body.surfaces])
    corners = body.vertices[faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(outward, axis=-1)
    agree = np.sum(outward * body.normals[faces[:, 0]], axis=-1)[area > 1e-7]
    assert (agree > 0).mean() > 0.99  # hems and eyelids are rounded more tightly than triangles are fine
