"""Distances on one grid and on many are the same, and their slopes are the true ones."""

import numpy as np
import pytest
import torch
from roam_character.distance import DistanceGrid, DistanceGrids, turn_about_y


def ball(radius: float, yaw: float = 0.0, nodes: int = 25, pitch: float = 0.05) -> DistanceGrid:
    """The distance from a ball about (0.1, 0.2, 0.3) in the grid's own axes."""
    origin = np.array([0.1, 0.2, 0.3]) - pitch * (nodes - 1) / 2
    axis = pitch * np.arange(nodes) - pitch * (nodes - 1) / 2
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    return DistanceGrid(origin, pitch, (np.sqrt(x * x + y * y + z * z) - radius).astype(np.float32), yaw)


@pytest.fixture
def points():
    return torch.rand(3, 200, 3, generator=torch.Generator().manual_seed(1)) * 2.4 - 1.0


def test_a_grid_for_every_character_says_what_each_grid_says(points):
    small, large = ball(0.2, yaw=0.7), ball(0.45, nodes=31)
    distance, slope = DistanceGrids.of([small, large, small]).tangent(points)
    for row, grid in enumerate((small, large, small)):
        expected, direction = grid.tangent(points[row])
        torch.testing.assert_close(distance[row], expected, atol=2e-5, rtol=1e-4)
        kinks = (slope[row] - direction).norm(dim=-1) > 1e-2  # on the planes between cells either side's slope is right
        assert kinks.float().mean() < 0.02


def test_distances_inside_the_box_are_those_of_the_ball():
    grid = ball(0.2, yaw=0.7)
    inside = torch.tensor([[0.1, 0.2, 0.3], [0.1, 0.5, 0.3], [0.25, 0.2, 0.3]], dtype=torch.float64)
    world = (inside @ torch.tensor(turn_about_y(0.7)).T).float()
    expected = torch.tensor([-0.2, 0.1, -0.05])
    torch.testing.assert_close(grid.query(world), expected, atol=0.02, rtol=0)
    torch.testing.assert_close(DistanceGrids.of([grid]).tangent(world[None])[0][0], expected, atol=0.02, rtol=0)


def test_slopes_are_those_of_finite_differences(points):
    grids, step = DistanceGrids.of([ball(0.2, yaw=0.7), ball(0.45), ball(0.3)]), 1e-3
    _, slope = grids.tangent(points)
    ahead, behind = ([grids.tangent(points + s * step * e)[0] for e in torch.eye(3)] for s in (1, -1))
    found = torch.stack([(a - b) / (2 * step) for a, b in zip(ahead, behind, strict=True)], dim=-1)
    off = (found - slope).norm(dim=-1)
    assert float(off.median()) < 1e-3
    assert float((off > 0.05).float().mean()) < 0.05  # steps across the planes between cells


def test_some_characters_of_a_batch_keep_their_own_grids(points):
    grids = DistanceGrids.of([ball(0.2), ball(0.45, nodes=31), ball(0.3)])
    chosen = torch.tensor([2, 0])
    some, _ = grids.of_rows(chosen).tangent(points[chosen])
    every, _ = grids.tangent(points)
    assert torch.equal(some, every[chosen])
