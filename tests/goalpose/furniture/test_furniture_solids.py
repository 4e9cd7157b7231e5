"""Every solid's sign is exact, its mesh lies on its surface, and its normals point outwards."""

import numpy as np
import pytest
from roam_goalpose.furniture.sheets import Prism, Sheet, Wall, smooth_curve
from roam_goalpose.furniture.solids import Box, Loft, Pillow, Solid, Tube, turn_x, turn_y, vector

SOLIDS: dict[str, Solid] = {
    "box": Box(center=vector(0.1, 0.4, 0), half=vector(0.3, 0.1, 0.2), rotation=turn_x(0.3)),
    "rounded box": Box(half=vector(0.3, 0.1, 0.2), radius=0.06),
    "post": Loft(
        heights=np.array([0.0, 0.5]), half=np.array([[0.02, 0.02], [0.04, 0.04]]), shift=np.array([[0, 0], [0.1, 0.05]])
    ),
    "disc": Loft(heights=np.array([0.0, 0.02, 0.05]), half=np.array([[0.2, 0.2], [0.25, 0.2], [0.2, 0.2]]), power=2.0),
    "pillow": Pillow(half=vector(0.3, 0.08, 0.25), rotation=turn_y(0.5)),
    "tube": Tube(path=np.array([(0, 0, 0), (0.1, 0.3, 0.05)]), radius=0.03),
    "sheet": Sheet(
        profile=smooth_curve(np.array([(-0.3, 0.9), (-0.27, 0.7), (-0.2, 0.52), (0.2, 0.45)]), count=20),
        thickness=0.02,
        half_width=np.full(20, 0.22),
        bend=np.full(20, 0.02),
    ),
    "prism": Prism(outline=np.array([(0, 0), (0.4, 0), (0.4, 0.2), (0.1, 0.3), (0.0, 0.5)]), half_width=0.1),
    "wall": Wall(radius=vector(0.3, 0.25), thickness=0.05, sweep=1.7, bottom=0.1, top=vector(0.8, 0.6), lean=0.1),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_mesh_lies_on_the_surface(name: str) -> None:
    solid = SOLIDS[name]
    vertices, faces = solid.mesh
    distance = solid.distance(vertices[faces].mean(1))
    assert np.quantile(np.abs(distance), 0.9) < 0.006  # curved solids are meshed with chords


@pytest.mark.parametrize("name", SOLIDS)
def test_normals_point_outwards(name: str) -> None:
    solid = SOLIDS[name]
    vertices, faces = solid.mesh
    a, b, c = vertices[faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    middle = (a + b + c) / 3
    assert np.mean(solid.distance(middle + 0.012 * normal) > solid.distance(middle - 0.012 * normal)) > 0.97


@pytest.mark.parametrize("name", SOLIDS)
def test_volume_of_occupancy_matches_the_mesh(name: str) -> None:
    """Two independent descriptions of a solid, its distance and its triangles, enclose the same volume."""
    solid = SOLIDS[name]
    vertices, faces = solid.mesh
    a, b, c = vertices[faces].transpose(1, 0, 2)
    of_mesh = abs(float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum())) / 6
    low, high = solid.bounds + np.array([[-0.02], [0.02]])
    points = np.random.default_rng(0).uniform(low, high, (60_000, 3))
    of_distance = float(np.mean(solid.distance(points) < 0) * np.prod(high - low))
    assert of_distance == pytest.approx(of_mesh, rel=0.12)  # round parts are meshed with chords, inside the true shape


def test_box_distance_is_exact() -> None:
    box = Box(half=vector(1.0, 2.0, 3.0))
    points = np.array([[2.0, 0, 0], [2.0, 3.0, 0], [0.5, 0, 0], [2, 3, 4]])
    assert box.distance(points) == pytest.approx([1.0, np.sqrt(2), -0.5, np.sqrt(3)])


def test_tube_distance_is_exact() -> None:
    tube = Tube(path=np.array([(0, 0, 0), (0, 1, 0)]), radius=0.25)
    assert tube.distance(np.array([[1, 0.5, 0], [0, 1.5, 0], [0, 0.5, 0]], float)) == pytest.approx([0.75, 0.25, -0.25])
