"""Inside and outside of meshes with holes, no underside, or no thickness."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from roam_goalpose.furniture import generate
from roam_goalpose.training.examples import from_mesh, is_held_out
from roam_goalpose.training.labels import label_mesh


def test_closed_box() -> None:
    labels = label_mesh(trimesh.creation.box((0.6, 0.4, 0.5), trimesh.transformations.translation_matrix((0, 0.2, 0))))
    distance = labels.distance(np.array([[0, 0.2, 0], [0.25, 0.2, 0], [0.4, 0.2, 0], [0, 0.5, 0]]))
    assert distance == pytest.approx([-0.2, -0.05, 0.1, 0.1], abs=0.012)


def test_box_without_underside_is_solid() -> None:
    """Many sofas are open below; the floor closes them."""
    box = trimesh.creation.box((0.6, 0.4, 0.5), trimesh.transformations.translation_matrix((0, 0.2, 0)))
    open_box = trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 1] > -0.5])
    assert not open_box.is_watertight
    assert label_mesh(open_box).distance(np.array([[0.0, 0.2, 0.0]]))[0] < -0.1


def test_an_upholstered_body_without_an_underside_is_solid_on_its_feet_too() -> None:
    """Air would come in from below, a hand's breadth over the floor; under a table there is room for legs."""
    feet = [(x, z) for x in (-0.35, 0.35) for z in (-0.3, 0.3)]

    def standing(low: float, height: float) -> trimesh.Trimesh:
        move = trimesh.transformations.translation_matrix
        body = trimesh.creation.box((0.8, height, 0.7), move((0, low + height / 2, 0)))
        hull = trimesh.Trimesh(body.vertices, body.faces[body.face_normals[:, 1] > -0.5])
        legs = [trimesh.creation.box((0.05, low, 0.05), move((x, low / 2, z))) for x, z in feet]
        return trimesh.util.concatenate([hull, *legs])

    assert label_mesh(standing(0.12, 0.3)).distance(np.array([[0.0, 0.3, 0.0]]))[0] < -0.08
    assert label_mesh(standing(0.60, 0.1)).distance(np.array([[0.0, 0.3, 0.0]]))[0] > 0.2


def test_sheet_is_as_thick_as_its_skin_only() -> None:
    sheet = trimesh.Trimesh(
        [(-0.3, 0.5, -0.3), (0.3, 0.5, -0.3), (0.3, 0.5, 0.3), (-0.3, 0.5, 0.3)], [(0, 1, 2), (0, 2, 3)]
    )
    distance = label_mesh(sheet).distance(np.array([[0, 0.5, 0], [0, 0.52, 0], [0, 0.48, 0]]))
    assert distance[0] < 0
    assert distance[1:] == pytest.approx([0.015, 0.015], abs=0.004)


def test_space_under_a_table_is_outside() -> None:
    piece = generate("stool", 3)
    labels = label_mesh(piece.to_trimesh())
    points = np.random.default_rng(0).uniform(piece.bounds[0] - 0.1, piece.bounds[1] + 0.1, (4000, 3))
    clear = np.abs(piece.distance(points)) > 0.02
    assert np.mean((labels.distance(points) < 0)[clear] == piece.occupancy(points)[clear]) > 0.98


@pytest.mark.parametrize("category", ["chair", "armchair", "sofa", "bed"])
def test_mesh_labels_agree_with_exact_occupancy(category: str) -> None:
    """The flood fill, run on the triangles of a generated piece, finds what its solids say."""
    piece = generate(category, 7)
    labels = label_mesh(piece.to_trimesh())
    points = np.random.default_rng(0).uniform(piece.bounds[0] - 0.05, piece.bounds[1] + 0.05, (4000, 3))
    inside, clear = piece.occupancy(points), np.abs(piece.distance(points)) > 0.015
    assert np.mean((labels.distance(points) < 0)[clear] == inside[clear]) > 0.98


def test_held_out_share_is_fixed() -> None:
    names = [f"chair_{k}.glb" for k in range(2000)]
    held = [name for name in names if is_held_out(name)]
    assert 0.11 < len(held) / len(names) < 0.19
    assert held == [name for name in names if is_held_out(name)]


def test_real_meshes_are_held_out_in_every_category(objects: Path) -> None:
    files = [path.name for path in (objects / "train").glob("*.glb")]
    held = {name.split("_")[0] for name in files if is_held_out(name)}
    assert held == {name.split("_")[0] for name in files}


def test_real_mesh_becomes_an_example(objects: Path) -> None:
    path = sorted((objects / "train").glob("sofa_*.glb"))[0]
    example = from_mesh(path, category="sofa", seat_height=0.4)
    inside = example.distance < 0
    uniform = inside[: len(inside) // 2]
    assert 0.05 < uniform.mean() < 0.7
    assert np.isfinite(example.surface.astype(np.float32)).all()
