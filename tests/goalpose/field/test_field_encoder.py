"""What anchors see around them turns with the object or does not change."""

import numpy as np
import torch
from roam_goalpose.field.encoder import SCALES, VectorBlock, neighbourhoods, spread, squared_distances
from scipy.spatial.transform import Rotation


def turn() -> torch.Tensor:
    return torch.from_numpy(Rotation.random(rng=np.random.default_rng(3)).as_matrix())


def test_anchors_lie_apart_whatever_the_batch() -> None:
    """Of points in random order on a square, the chosen ones leave smaller holes than the first ones would."""
    points = torch.rand(3, 1500, 3, generator=torch.Generator().manual_seed(0)) * torch.tensor([1.0, 0.0, 1.0])
    rows = spread(points, 100)
    assert all(len(set(row.tolist())) == 100 for row in rows)
    chosen = points.gather(1, rows[..., None].expand(-1, -1, 3))
    hole = torch.cdist(points, chosen).amin(-1).amax(-1)
    assert (hole < 0.8 * torch.cdist(points, points[:, :100]).amin(-1).amax(-1)).all()
    assert torch.equal(spread(points[1:2], 100), rows[1:2])


def test_few_points_are_all_anchors() -> None:
    assert spread(torch.rand(2, 20, 3), 128).sort(-1).values.tolist() == [list(range(20))] * 2


def test_squared_distances() -> None:
    a, b = torch.randn(2, 5, 3, dtype=torch.float64), torch.randn(2, 7, 3, dtype=torch.float64)
    assert torch.allclose(squared_distances(a, b), torch.cdist(a, b) ** 2)


def test_neighbourhood_vectors_turn_and_scalars_stay() -> None:
    points = torch.randn(1, 200, 3, dtype=torch.float64) * 0.3
    anchors, r = points[:, :40], turn()
    vectors, scalars = neighbourhoods(anchors, points)
    turned_vectors, turned_scalars = neighbourhoods(anchors @ r.T, points @ r.T)
    assert torch.allclose(turned_vectors, torch.einsum("ij,bjmc->bimc", r, vectors), atol=1e-9)
    assert torch.allclose(turned_scalars, scalars, atol=1e-9)


def test_neighbourhood_mean_agrees_with_a_plain_loop() -> None:
    points = torch.randn(1, 50, 3, dtype=torch.float64) * 0.2
    vectors, _ = neighbourhoods(points[:, :3], points)
    for k, sigma in enumerate(SCALES):
        weight = torch.exp(-((points[0] - points[0, 1]) ** 2).sum(-1) / (2 * sigma**2))
        mean = (weight[:, None] * points[0]).sum(0) / weight.sum()
        assert torch.allclose(vectors[0, :, 1, 1 + k], (mean - points[0, 1]) / sigma)


def test_block_is_equivariant() -> None:
    torch.manual_seed(0)
    block = VectorBlock(8, 6, 4).double()
    vectors, scalars = torch.randn(1, 3, 10, 8, dtype=torch.float64), torch.randn(1, 10, 6, dtype=torch.float64)
    smoothing, r = torch.softmax(torch.randn(1, 10, 10, dtype=torch.float64), -1), turn()
    out_vectors, out_scalars = block(vectors, scalars, smoothing)
    turned_vectors, turned_scalars = block(torch.einsum("ij,bjnc->binc", r, vectors), scalars, smoothing)
    assert torch.allclose(turned_vectors, torch.einsum("ij,bjnc->binc", r, out_vectors))
    assert torch.allclose(turned_scalars, out_scalars)
