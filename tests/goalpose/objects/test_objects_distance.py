import io

import numpy as np
import pytest
import torch
import trimesh
from box_furniture import box, box_chair, box_sofa
from roam_goalpose.objects import load_shape

LOW, HIGH = np.array([-0.25, 0.0, -0.3]), np.array([0.25, 0.45, 0.3])


def _box_distance(points):
    centred = np.abs(points - (LOW + HIGH) / 2) - (HIGH - LOW) / 2
    return np.linalg.norm(np.maximum(centred, 0), axis=-1) + np.minimum(centred.max(axis=-1), 0)


def _load(mesh):
    return load_shape(mesh.export(file_type="glb"), "glb")


@pytest.fixture(scope="module")
def block():
    return _load(box(LOW, HIGH)).distance


@pytest.fixture(scope="module")
def chair():
    return _load(box_chair()).distance


def _points(count, margin, seed=0):
    return np.random.default_rng(seed).uniform(LOW - margin, HIGH + margin, (count, 3))


def test_distance_to_a_box_inside_the_grid(block):
    points = _points(20_000, 0.12)
    error = block.sample(points) - _box_distance(points)
    assert np.abs(error).mean() < 0.001
    assert np.percentile(np.abs(error), 99) < 0.005
    assert np.abs(error).max() < 0.01


def test_distance_to_a_turned_box():
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 0.5])
    mesh = box(LOW, HIGH).apply_transform(turn)
    points = _points(20_000, 0.1)
    turned = points @ turn[:3, :3].T
    error = _load(mesh).distance.sample(turned) - _box_distance(points)
    assert np.abs(error).mean() < 0.002
    assert np.percentile(np.abs(error), 99) < 0.008


def test_far_away_the_distance_is_an_upper_bound_that_grows(block):
    points = _points(2000, 3.0)
    true = _box_distance(points)
    found = block.sample(points)
    assert (found > true - 0.01).all()
    assert (found < true * 1.5 + 0.05).all()


def test_the_gradient_points_away_from_the_surface(block):
    points = torch.tensor(_points(3000, 0.5), dtype=torch.float64, requires_grad=True)
    distance = block.query(points)
    (gradient,) = torch.autograd.grad(distance.sum(), points)
    step = 1e-4
    ahead = torch.tensor(_box_distance((points + step * gradient).detach().numpy()))
    behind = torch.tensor(_box_distance((points - step * gradient).detach().numpy()))
    slope = (ahead - behind) / (2 * step)
    outside = distance > 0.02
    assert (slope[outside] > 0.3).double().mean() > 0.98
    assert torch.isfinite(gradient).all()
    assert gradient.norm(dim=-1).median() == pytest.approx(1.0, abs=0.05)


def test_the_gradient_is_that_of_the_value(block):
    """Off the cell faces, where the interpolation is smooth; inside the grid and outside it."""
    for margin in (0.05, 2.0):
        points = torch.tensor(_points(200, margin, seed=3), dtype=torch.float64)
        cell = (points - torch.as_tensor(block.origin)) / block.pitch
        smooth = ((cell - cell.round()).abs() > 1e-3).all(dim=-1)
        points = points[smooth].requires_grad_()
        (gradient,) = torch.autograd.grad(block.query(points).sum(), points)
        with torch.no_grad():
            steps = 1e-6 * torch.eye(3, dtype=torch.float64)
            slopes = [(block.query(points + step) - block.query(points - step)) / 2e-6 for step in steps]
        torch.testing.assert_close(gradient, torch.stack(slopes, dim=-1), atol=1e-5, rtol=1e-5)


def test_query_keeps_shape_dtype_and_works_under_vmap(block):
    points = torch.tensor(_points(24, 0.2)).reshape(2, 3, 4, 3)
    assert block.query(points).shape == (2, 3, 4)
    assert block.query(points).dtype == torch.float64
    assert block.query(points.float()).dtype == torch.float32
    mapped = torch.func.vmap(block.query)(points)
    torch.testing.assert_close(mapped, block.query(points))


def test_the_parts_of_a_chair(chair):
    inside = [[0, 0.445, 0], [0, 0.8, -0.22], [0.2, 0.2, 0.2]]
    outside = [[0, 0.2, 0], [0, 0.6, 0], [0, 0.52, 0.1], [0, 0.2, 0.3], [0, -0.05, 0], [0.4, 0.5, 0.0]]
    assert (chair.sample(np.array(inside)) < -0.005).all()
    assert (chair.sample(np.array(outside)) > 0.02).all()
    assert chair.sample(np.array([0, 0.57, 0.05])) == pytest.approx(0.1, abs=0.01)


def test_overlapping_parts_are_one_body():
    """Faces inside the sofa's body are not surface: going down through the seat, depth only grows."""
    distance = _load(box_sofa()).distance
    down = distance.sample(np.stack([np.zeros(15), np.linspace(0.40, 0.24, 15), np.full(15, 0.1)], axis=1))
    assert (np.diff(down) < 0.001).all()
    assert down[-1] == pytest.approx(-0.18, abs=0.01)


@pytest.mark.parametrize("missing", ["underside", "underside of a raised body"])
def test_a_body_without_an_underside_is_solid(missing):
    mesh = box_sofa()
    if missing != "underside":
        mesh.vertices[mesh.vertices[:, 1] < 0.01, 1] = 0.12
    mesh.update_faces(mesh.triangles_center[:, 1] > mesh.bounds[0, 1] + 1e-3)
    feet = [box((x, 0, z), (x + 0.05, 0.13, z + 0.05)) for x in (-0.9, 0.85) for z in (-0.425, 0.375)]
    distance = _load(trimesh.util.concatenate([mesh, *feet])).distance
    assert distance.sample(np.array([0.0, 0.33, 0.1])) < -0.06
    assert distance.sample(np.array([0.0, 0.6, 0.1])) > 0.1


def test_inconsistent_winding_does_not_matter(chair):
    mesh = box_chair()
    flip = np.random.default_rng(0).random(len(mesh.faces)) < 0.5
    mesh.faces[flip] = mesh.faces[flip][:, ::-1]
    points = _points(2000, 0.2)
    np.testing.assert_allclose(_load(mesh).distance.sample(points), chair.sample(points), atol=0.01)


def test_a_sheet_is_given_thickness():
    """An open shell: a seat and a back without thickness."""
    seat = trimesh.Trimesh(
        [[-0.25, 0.45, -0.25], [0.25, 0.45, -0.25], [0.25, 0.45, 0.25], [-0.25, 0.45, 0.25]], [[0, 1, 2, 3]]
    )
    back = trimesh.Trimesh(
        [[-0.25, 0.45, -0.25], [0.25, 0.45, -0.25], [0.25, 0.9, -0.3], [-0.25, 0.9, -0.3]], [[0, 1, 2, 3]]
    )
    legs = [box((x, 0, z), (x + 0.02, 0.45, z + 0.02)) for x in (-0.25, 0.23) for z in (-0.25, 0.23)]
    distance = _load(trimesh.util.concatenate([seat, back, *legs])).distance
    x = np.linspace(-0.18, 0.18, 50)
    on_seat = distance.sample(np.stack([x, np.full(50, 0.45), x], axis=1))
    assert (on_seat < -0.0015).all()
    assert distance.sample(np.array([0.0, 0.55, 0.0])) == pytest.approx(0.1, abs=0.012)
    assert distance.sample(np.array([0.0, 0.35, 0.0])) == pytest.approx(0.1, abs=0.012)


@pytest.mark.parametrize("count", [2000, 20_000])
def test_a_point_cloud_has_an_inside_too(count):
    points = np.asarray(trimesh.sample.sample_surface(box(LOW, HIGH), count, seed=2)[0])
    points += np.random.default_rng(0).normal(0, 0.001, points.shape)
    stream = io.BytesIO()
    np.save(stream, points)
    distance = load_shape(stream.getvalue(), "npy", up="y").distance
    queries = _points(5000, 0.1)
    true = _box_distance(queries)
    found = distance.sample(queries)
    clear = np.abs(true) > 0.03
    assert (np.sign(found) == np.sign(true))[clear].mean() > 0.995
    assert np.abs(found - true)[true > 0].mean() < 0.012


def test_the_grid_stays_small_whatever_the_mesh():
    fine = box_sofa().subdivide_to_size(0.03)
    coarse = _load(box_sofa()).distance
    grid = _load(fine).distance
    assert grid.values.shape == coarse.values.shape
    assert grid.values.size < 700_000
    points = _points(2000, 0.3)
    difference = np.abs(grid.sample(points) - coarse.sample(points))
    assert difference.mean() < 0.002
    assert difference.max() < 0.03
