"""Up, front and seat height read off the field, for furniture it never saw, turned any way."""

from pathlib import Path

import numpy as np
import pytest
import torch
from roam_goalpose.field import Field, estimate_frame
from roam_goalpose.furniture import generate
from scipy.spatial.transform import Rotation

WEIGHTS = Path(__file__).parents[3] / "weights" / "field.safetensors"


@pytest.fixture(scope="module")
def field() -> Field:
    return Field.load(WEIGHTS)


def cloud(seed: int) -> tuple[torch.Tensor, float]:
    piece = generate("chair", seed)
    points = piece.sample_surface(1024, seed=0)[0].astype(np.float32)
    return torch.from_numpy(points)[None], piece.seat_height


def test_unseen_chairs_face_forward(field: Field) -> None:
    """Heading within 20 degrees, seat within 8 cm, on nine of ten chairs."""
    right = []
    for seed in range(1_000_000, 1_000_020):
        points, seat = cloud(seed)
        frame = estimate_frame(field, field.encode(points))
        heading = torch.atan2(frame.front[0, 0], frame.front[0, 2]).abs()
        right.append(bool(heading < np.deg2rad(20)) and abs(float(frame.seat_offset[0]) - seat) < 0.08)
    assert np.mean(right) >= 0.9


@pytest.mark.parametrize("seed", range(3))
def test_frame_turns_with_the_object(field: Field, seed: int) -> None:
    points, _ = cloud(1_000_000 + seed)
    turn = torch.from_numpy(Rotation.random(rng=np.random.default_rng(seed)).as_matrix().astype(np.float32))
    straight = estimate_frame(field, field.encode(points))
    turned = estimate_frame(field, field.encode(points @ turn.T))
    assert torch.allclose(turned.up, straight.up @ turn.T, atol=1e-3)
    assert torch.allclose(turned.front, straight.front @ turn.T, atol=1e-3)
    assert torch.allclose(turned.seat_offset, straight.seat_offset, atol=1e-3)
