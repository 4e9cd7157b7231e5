"""Furniture that was exported leaning is set on its feet; what stands is left as it is, to the bit."""

import numpy as np
import pytest
import trimesh
from box_furniture import box, box_chair, box_sofa
from roam_goalpose.furniture import generate
from roam_goalpose.objects import load_shape
from roam_goalpose.objects.placing.tilt import stands, turn_to_y
from scipy.spatial.transform import Rotation


def leaning(
    mesh: trimesh.Trimesh, degrees: float, axis: tuple[float, float, float]
) -> tuple[trimesh.Trimesh, np.ndarray]:
    """The mesh turned about a horizontal axis, and its turn [3, 3]."""
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array(axis) / np.linalg.norm(axis)).as_matrix()
    return trimesh.Trimesh(mesh.vertices @ turn.T, mesh.faces, process=False), turn


@pytest.mark.parametrize("make", [box_chair, lambda: generate("armchair", 5).to_trimesh()])
@pytest.mark.parametrize(
    ("degrees", "axis"), [(20.0, (1.0, 0.0, 0.4)), (-35.0, (0.3, 0.0, 1.0)), (40.0, (-1.0, 0, 0.2))]
)
def test_a_leaning_upload_is_set_on_its_feet(make, degrees, axis):
    mesh, turn = leaning(make(), degrees, axis)
    shape = load_shape(mesh.export(file_type="glb"), "glb")
    assert [warning.reason for warning in shape.warnings] == ["OBJECT_TILTED"]
    assert f"{abs(degrees):.0f}°" in shape.warnings[0].message
    np.testing.assert_allclose(shape.object_to_world[:3, :3] @ turn @ [0, 1, 0], [0, 1, 0], atol=0.01)
    assert np.ptp(shape.bounds[:, 1]) == pytest.approx(np.ptp(make().vertices[:, 1]), abs=0.01)


def test_an_up_axis_that_is_given_is_obeyed_but_the_lean_is_told():
    mesh, _ = leaning(box_chair(), 25.0, (1, 0, 0.5))
    shape = load_shape(mesh.export(file_type="glb"), "glb", up="y")
    np.testing.assert_array_equal(shape.object_to_world, np.eye(4))
    assert [warning.reason for warning in shape.warnings] == ["OBJECT_TILTED"]
    assert "left so" in shape.warnings[0].message


def test_a_block_that_looks_the_same_on_its_side_is_left_and_told():
    mesh, _ = leaning(box_sofa(), 20.0, (1, 0, 0.4))
    shape = load_shape(mesh.export(file_type="glb"), "glb")
    np.testing.assert_array_equal(shape.object_to_world, np.eye(4))
    assert "left so" in shape.warnings[0].message


@pytest.mark.parametrize("category", ["chair", "officechair", "stool", "bench", "lounger", "bed"])
def test_what_stands_is_left_alone(category):
    shape = load_shape(generate(category, 3).to_trimesh().export(file_type="glb"), "glb")
    np.testing.assert_array_equal(shape.object_to_world, np.eye(4))
    assert shape.warnings == ()


def test_a_short_foot_is_no_lean():
    legs = [
        box((x, 0.01 * (x > 0 and z > 0), z), (x + 0.04, 0.45, z + 0.04)) for x in (-0.2, 0.16) for z in (-0.2, 0.16)
    ]
    stool = trimesh.util.concatenate([box((-0.2, 0.42, -0.2), (0.2, 0.45, 0.2)), *legs])
    assert stands(stool.vertices, stool.centroid)
    assert load_shape(stool.export(file_type="glb"), "glb").warnings == ()


@pytest.mark.parametrize("up", [(0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.0, 0.8), (0.36, -0.8, 0.48)])
def test_any_direction_turns_up(up):
    turn = turn_to_y(np.array(up))
    np.testing.assert_allclose(turn @ up, [0, 1, 0], atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
