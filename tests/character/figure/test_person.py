"""The figure: its size and shape, on our skeleton and on others, and that the generator still makes it."""

from dataclasses import replace

import numpy as np
import pytest
from roam_character.documents.gltf_document import GltfDocument, node_matrix
from roam_character.figure.modelling import modelling_stance
from roam_character.figure.person import FILE, STEP, figure_mesh
from roam_character.formats.glb import glb_bytes
from roam_character.mesh import rest_origins
from roam_character.pose import Pose
from roam_character.rotation import quat_from_rotvec
from roam_character.skeleton import humanoid_skeleton, load_skeleton


def sitting() -> Pose:
    skeleton = humanoid_skeleton()
    vectors = np.zeros((skeleton.joint_count, 3))
    for side, sign in (("left", 1), ("right", -1)):
        vectors[skeleton.index(f"{side}UpperLeg")] = [-1.5, 0, 0]
        vectors[skeleton.index(f"{side}LowerLeg")] = [1.5, 0, 0]
        vectors[skeleton.index(f"{side}UpperArm")] = [0, 0, -1.2 * sign]
    return Pose(skeleton, np.array([0.3, 0.5, -0.2]), quat_from_rotvec(vectors))


def test_it_is_as_tall_as_the_skeleton_and_stands_on_the_floor():
    body = figure_mesh(humanoid_skeleton())
    assert body.vertices[:, 1].min() == pytest.approx(0, abs=0.004)
    assert 1.68 < body.vertices[:, 1].max() < 1.72
    assert np.ptp(body.vertices[:, 0]) == pytest.approx(1.69, abs=0.03)  # finger tip to finger tip


def test_it_has_hands_a_face_and_clothes():
    body = figure_mesh(humanoid_skeleton())
    names = [surface.name for surface in body.surfaces]
    assert set(names) == {"skin", "eyes", "irises", "hair", "lips", "shirt", "trousers", "shoes", "soles"}
    skin = body.vertices[np.unique(body.surfaces[names.index("skin")].faces)]
    fingers = skin[(skin[:, 0] > 0.79) & (skin[:, 0] < 0.82)]
    gaps = np.diff(np.sort(fingers[:, 2]))
    assert (gaps > 0.0015).sum() >= 2  # three of the four fingers reach so far, with air between them


def test_weights_are_smooth_and_of_four_bones_at_most():
    body = figure_mesh(humanoid_skeleton())
    assert np.allclose(body.weights.sum(axis=1), 1)
    assert (body.weights >= 0).all()
    shirt = next(surface for surface in body.surfaces if surface.name == "shirt")
    assert ((body.weights[np.unique(shirt.faces)] > 0.1).sum(axis=1) >= 2).mean() > 0.5


def test_it_is_the_same_on_both_sides():
    body = figure_mesh(humanoid_skeleton())
    left, right = body.vertices[body.vertices[:, 0] > 0.02], body.vertices[body.vertices[:, 0] < -0.02]
    for axis in (1, 2):
        quantiles = [np.quantile(side[:, axis], [0.05, 0.5, 0.95]) for side in (left, right)]
        assert np.allclose(*quantiles, atol=0.01)


@pytest.mark.parametrize("scale", [0.6, 1.25])
def test_it_takes_the_proportions_of_another_skeleton(scale: float):
    ours = humanoid_skeleton()
    other = replace(ours, rest_offsets=(ours.rest_offsets * scale).astype(np.float32))
    assert np.allclose(figure_mesh(other).vertices, figure_mesh(ours).vertices * scale, atol=0.01)


def test_long_shanks_are_long_and_not_thick():
    ours = humanoid_skeleton()
    offsets = ours.rest_offsets.copy()
    for side in ("left", "right"):
        offsets[ours.index(f"{side}Foot")] *= 1.3
    offsets[0, 1] += 0.3 * 0.42
    long, plain = figure_mesh(replace(ours, rest_offsets=offsets)), figure_mesh(ours)
    assert long.vertices[:, 1].min() == pytest.approx(0, abs=0.02)
    calf = np.abs(plain.vertices[:, 1] - 0.35) < 0.01
    assert np.ptp(long.vertices[calf, 2]) < 1.3 * np.ptp(plain.vertices[calf, 2])


def test_a_skeleton_with_more_spine_joints_gets_it_too():
    paper = load_skeleton("paper")
    body = figure_mesh(paper)
    assert body.joints.max() < paper.joint_count
    assert abs(body.vertices[:, 1].max() - (rest_origins(paper)[:, 1].max() + 0.18)) < 0.06


def test_a_file_holds_it_within_two_megabytes_with_the_joints_where_they_should_be():
    pose = sitting()
    data = glb_bytes(pose)
    assert len(data) < 2_000_000
    document = GltfDocument.read(data)
    world = np.zeros((pose.skeleton.joint_count, 4, 4))
    for joint, parent in enumerate(pose.skeleton.parents):
        local = node_matrix(document.json["nodes"][joint])
        world[joint] = local if parent < 0 else world[parent] @ local
    assert np.abs(world[:, :3, 3] - pose.positions()).max() < 0.001


def test_sitting_neither_tears_nor_folds_it():
    pose = sitting()
    body = figure_mesh(pose.skeleton)
    posed = body.posed(pose.skeleton, *pose.posture())
    faces = np.concatenate([surface.faces for surface in body.surfaces])
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    before = np.linalg.norm(np.subtract(*body.vertices[edges.T]), axis=-1)
    after = np.linalg.norm(np.subtract(*posed[edges.T]), axis=-1)
    assert np.quantile(after / np.maximum(before, 1e-4), 0.995) < 2.5
    assert after[before < 0.03].max() < 0.08  # longer ones lie flat inside, where clothes are closed


def test_the_generator_makes_what_is_shipped():
    pytest.importorskip("skimage", reason="needs scikit-image: pip install 'roam-services[figure]'")
    pytest.importorskip("fast_simplification", reason="needs fast-simplification: pip install 'roam-services[figure]'")
    from roam_character.figure.garments import pieces
    from roam_character.figure.surface import triangles

    stance = modelling_stance(humanoid_skeleton())
    sole = next(piece for piece in pieces(stance) if piece.material.name == "soles")
    vertices, _, _ = triangles(sole)
    # A sole moves with the foot alone but for its front: compare behind the ball, in the foot's own frame.
    joint = stance.skeleton.index("leftFoot")
    local = (vertices - stance.places[joint]) @ stance.turns[joint] + stance.origins[joint]
    behind = local[local[:, 2] < 0.02]
    with np.load(FILE) as file:
        shipped = file["vertices"] * STEP
    far = [np.linalg.norm(shipped - point, axis=-1).min() for point in behind[::20]]
    assert max(far) < 0.0005
