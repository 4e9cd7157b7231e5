import math

import numpy as np
import pytest
import trimesh
from box_furniture import box, box_chair, box_sofa
from roam_character.distance import turn_about_y
from roam_goalpose.objects import load_shape
from roam_goalpose.objects.own_axes import in_own_axes
from roam_goalpose.objects.placing.heading import Heading, find_heading


def _turned(mesh: trimesh.Trimesh, yaw: float) -> tuple[np.ndarray, np.ndarray]:
    return mesh.vertices @ turn_about_y(yaw).T, mesh.faces


def _heading(mesh: trimesh.Trimesh, yaw: float) -> Heading:
    return find_heading(*_turned(mesh, yaw))


@pytest.mark.parametrize("make", [box_chair, box_sofa])
@pytest.mark.parametrize("yaw", [0.0, 0.4, 2.0, -2.9])
def test_the_front_of_a_turned_object_is_the_turned_front(make, yaw):
    still, turned = _heading(make(), 0.0), _heading(make(), yaw)
    assert math.remainder(turned.yaw - still.yaw - yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
    assert math.remainder(still.yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)  # +Z, away from their backs
    assert still.clarity == turned.clarity == 1.0


def test_a_bench_has_axes_along_its_sides_but_no_front():
    found = _heading(box(np.array([-0.6, 0.0, -0.2]), np.array([0.6, 0.45, 0.2])), 0.3)
    assert math.sin(2 * (found.yaw - 0.3)) == pytest.approx(0.0, abs=1e-6)
    assert found.clarity == 0.0


SYMMETRIC = {
    "square stool": box(np.array([-0.2, 0.0, -0.2]), np.array([0.2, 0.45, 0.2])),
    "bench": box(np.array([-0.6, 0.0, -0.2]), np.array([0.6, 0.45, 0.2])),
    "round stool": trimesh.creation.cylinder(
        0.2, 0.45, 24, transform=trimesh.transformations.rotation_matrix(0.5 * np.pi, [1, 0, 0])
    ),
}


@pytest.mark.parametrize("name", SYMMETRIC)
@pytest.mark.parametrize("yaw", [0.3, 1.7, 2.9, -2.2])
def test_what_has_no_front_turns_with_its_upload_all_the_same(name, yaw):
    still, turned = _heading(SYMMETRIC[name], 0.0), _heading(SYMMETRIC[name], yaw)
    assert still.clarity == 0.0
    assert math.remainder(turned.yaw - still.yaw - yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-5)


def test_a_turned_upload_has_the_same_points_and_distances_in_its_own_axes():
    files = []
    for yaw, offset in ((0.0, 0.0), (0.7, 3.0)):
        vertices, faces = _turned(box_chair(), yaw)
        moved = trimesh.Trimesh(vertices + offset, faces, process=False)
        files.append(in_own_axes(load_shape(moved.export(file_type="ply"), "ply", unit="m", up="y"))[0])
    still, turned = files
    # Rounding puts a sample or two on the next triangle.
    assert (np.abs(turned.points - still.points).max(-1) < 1e-5).mean() > 0.999
    np.testing.assert_allclose(turned.distance.origin, still.distance.origin, atol=1e-5)
    apart = np.abs(turned.distance.values - still.distance.values)
    assert np.percentile(apart, 90) < 1e-6
    assert apart.max() < 2 * still.distance.pitch  # where a node lies midway between two samples


def test_points_and_poses_come_back_to_where_they_were():
    shape = load_shape(trimesh.Trimesh(*_turned(box_chair(), 0.7)).export(file_type="ply"), "ply", unit="m", up="y")
    own, placement = in_own_axes(shape)
    np.testing.assert_allclose(placement.point_to_world(own.points), shape.points, atol=1e-5)
    np.testing.assert_allclose(placement.point_to_own(shape.points), own.points, atol=1e-5)
    np.testing.assert_allclose(own.distance.sample(own.points), shape.distance.sample(shape.points), atol=1e-4)


def test_the_closed_form_gradient_is_that_of_autograd():
    torch = pytest.importorskip("torch")
    shape = load_shape(trimesh.Trimesh(*_turned(box_chair(), 0.7)).export(file_type="ply"), "ply", unit="m", up="y")
    random = np.random.default_rng(0)
    points = torch.tensor(random.uniform(-1.0, 1.5, (400, 3)), requires_grad=True)
    value = shape.distance.query(points)
    (gradient,) = torch.autograd.grad(value.sum(), points)
    found, slope = shape.distance.tangent(points.detach())
    torch.testing.assert_close(found, value.detach())
    torch.testing.assert_close(slope, gradient, atol=1e-5, rtol=1e-4)
