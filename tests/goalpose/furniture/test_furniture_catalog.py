"""Generated furniture is deterministic, has real sizes, and its labels are where one sits."""

import numpy as np
import pytest
from roam_goalpose.furniture import CATEGORIES, WITHIN, Furniture, generate

SEEDS = range(6)
KINDS = (*CATEGORIES, *WITHIN)
WIDTH = {"sofa": (0.5, 3.6), "daybed": (0.8, 2.5), "bench": (0.6, 2.2), "bed": (0.7, 2.4), "stool": (0.25, 1.1)}


def pieces(category: str) -> list[Furniture]:
    return [generate(category, seed) for seed in SEEDS]


@pytest.mark.parametrize("category", KINDS)
def test_same_seed_same_piece(category: str) -> None:
    first, second, other = generate(category, 3), generate(category, 3), generate(category, 4)
    assert np.array_equal(first.mesh[0], second.mesh[0])
    assert first.mesh[0].shape != other.mesh[0].shape or not np.allclose(first.mesh[0], other.mesh[0])


@pytest.mark.parametrize("category", KINDS)
def test_stands_on_the_floor_with_a_real_size(category: str) -> None:
    for piece in pieces(category):
        low, high = piece.bounds
        assert low[1] == pytest.approx(0, abs=1e-9)
        assert low[0] + high[0] == pytest.approx(0, abs=1e-9)
        smallest, largest = WIDTH.get(category, (0.28, 1.5))
        assert smallest < high[0] - low[0] < largest
        assert 0.2 < high[1] < 1.9


@pytest.mark.parametrize("category", KINDS)
def test_seat_points_lie_on_the_seat_with_room_above(category: str) -> None:
    """Free 12 cm above the point, solid within 12 cm below it or beside it (slats have gaps, cushions are soft)."""
    good, aside = [], np.linspace(-0.06, 0.06, 5)
    for piece in pieces(category):
        free = ~piece.occupancy(piece.seats + np.array([0, 0.12, 0]))
        steps = np.stack(np.meshgrid(aside, np.linspace(-0.12, -0.002, 13), aside), -1)
        below = piece.seats[:, None] + steps.reshape(-1, 3)
        solid = piece.occupancy(below.reshape(-1, 3)).reshape(len(piece.seats), -1).any(-1)
        good.append((free & solid).mean())
    assert np.mean(good) > 0.85


def test_back_is_behind_the_seat() -> None:
    """A chair faces +Z: over the seat there is more of it behind than in front."""
    for piece in pieces("chair"):
        points, _ = piece.sample_surface(2000, seed=0)
        above = points[points[:, 1] > piece.seat_height + 0.12]
        assert above[:, 2].mean() < piece.seats[0, 2] - 0.05


def test_surface_samples_are_visible_and_on_the_surface() -> None:
    piece = generate("armchair", 5)
    points, normals = piece.sample_surface(3000, seed=1)
    assert np.linalg.norm(normals, axis=-1) == pytest.approx(np.ones(3000))
    assert not piece.occupancy(points + 2e-3 * normals).mean() > 0.02
    assert np.mean(piece.occupancy(points - 6e-3 * normals)) > 0.95
    again, _ = piece.sample_surface(3000, seed=1)
    assert np.array_equal(points, again)


def test_occupancy_agrees_with_distance() -> None:
    piece = generate("sofa", 2)
    low, high = piece.bounds
    points = np.random.default_rng(0).uniform(low - 0.1, high + 0.1, (20_000, 3))
    assert np.array_equal(piece.occupancy(points), piece.distance(points) < 0)


def test_exports_as_a_mesh() -> None:
    mesh = generate("chair", 1).to_trimesh()
    assert len(mesh.faces) > 20
    assert mesh.bounds == pytest.approx(generate("chair", 1).bounds, abs=1e-6)


def test_unknown_category_is_refused() -> None:
    with pytest.raises(KeyError):
        generate("table", 0)
