"""What scanners and careless models leave of a cloud, and what training makes of that."""

import numpy as np
import pytest
from roam_goalpose.furniture import generate
from roam_goalpose.training.examples import from_furniture
from roam_goalpose.training.scans import CHANGES, above_underside, scan, seen_but_from


@pytest.fixture(scope="module")
def box() -> tuple[np.ndarray, np.ndarray]:
    """Six faces of a box 0.4 m high that stands 0.1 m over the floor, a point in the middle of each."""
    points = [(0, 0.1, 0), (0, 0.5, 0), (-0.3, 0.3, 0), (0.3, 0.3, 0), (0, 0.3, -0.3), (0, 0.3, 0.3)]
    normals = [(0, -127, 0), (0, 127, 0), (-127, 0, 0), (127, 0, 0), (0, 0, -127), (0, 0, 127)]
    return np.array(points, dtype=np.float32), np.array(normals, dtype=np.int8)


def test_the_underside_of_a_low_body_goes_and_that_of_a_high_one_stays(box: tuple[np.ndarray, np.ndarray]) -> None:
    points, normals = box
    assert above_underside(points, normals).tolist() == [False, True, True, True, True, True]
    assert above_underside(points + np.array([0, 0.3, 0], dtype=np.float32), normals).all()


def test_what_faces_the_missing_camera_is_unseen(box: tuple[np.ndarray, np.ndarray]) -> None:
    assert seen_but_from(box[1], np.pi).tolist() == [True, True, True, True, False, True]
    assert seen_but_from(box[1], np.pi / 2).tolist() == [True, True, True, False, True, True]


def test_normals_of_a_stored_body_point_outwards() -> None:
    piece = generate("sofa", 4)
    example = from_furniture(piece, name="sofa", seed=4)
    bounding = np.abs(example.normals).max(-1) > 0
    outside = example.surface[bounding].astype(np.float64) + 0.03 * example.normals[bounding] / 127
    assert bounding.mean() > 0.3
    assert piece.occupancy(outside).mean() < 0.03


def test_scans_have_the_wanted_number_of_points_near_the_surface() -> None:
    example = from_furniture(generate("sofa", 4), name="sofa", seed=4)
    random = np.random.default_rng(0)
    for _ in range(20):
        cloud = scan(example.surface.astype(np.float32), example.normals, random, 500)
        assert cloud.shape == (500, 3)
        assert cloud.dtype == np.float32


@pytest.mark.parametrize("change", CHANGES)
def test_changes_keep_enough_points(change: str) -> None:
    example = from_furniture(generate("sofa", 4), name="sofa", seed=4)
    cloud = CHANGES[change](example.surface.astype(np.float32), example.normals, np.random.default_rng(0))
    assert 500 <= len(cloud) <= 1500
    assert cloud.dtype == np.float32
