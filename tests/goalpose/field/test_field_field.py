"""The field is blind to where the object stands and how it is turned, and smooth in the query."""

from pathlib import Path

import numpy as np
import pytest
import torch
from roam_goalpose.field import Field, FieldConfig
from roam_goalpose.furniture import generate
from scipy.spatial.transform import Rotation
from torch import Tensor

WEIGHTS = Path(__file__).parents[3] / "weights" / "field.safetensors"


@pytest.fixture(scope="module")
def random_field() -> Field:
    torch.manual_seed(0)
    field = Field(FieldConfig(anchors=64, channels=16, scalars=16, frame=16, hidden=32))
    for parameter in field.parameters():  # zero-initialised layers would hide mistakes
        torch.nn.init.normal_(parameter, std=0.15) if parameter.ndim > 1 else None
    return field.requires_grad_(False).eval()


@pytest.fixture(scope="module")
def shipped_field() -> Field:
    return Field.load(WEIGHTS)


def cloud(category: str = "chair", seed: int = 1, count: int = 1024) -> Tensor:
    points, _ = generate(category, seed).sample_surface(count, seed=0)
    return torch.from_numpy(points.astype(np.float32))[None]


def queries(points: Tensor, count: int = 200) -> Tensor:
    low, high = points[0].amin(0) - 0.1, points[0].amax(0) + 0.1
    return low + (high - low) * torch.rand(1, count, 3, generator=torch.Generator().manual_seed(1))


@pytest.mark.parametrize("which", ["random_field", "shipped_field"])
@pytest.mark.parametrize("category", ["chair", "sofa"])
@pytest.mark.parametrize("seed", range(4))
def test_descriptors_ignore_rotation_and_translation(
    which: str, category: str, seed: int, request: pytest.FixtureRequest
) -> None:
    """Any full rotation of the upload, and a move of several metres, change no descriptor number by 1e-4."""
    field: Field = request.getfixturevalue(which)
    points = cloud(category, seed)
    where = queries(points)
    turn = torch.from_numpy(Rotation.random(rng=np.random.default_rng(seed)).as_matrix().astype(np.float32))
    shift = torch.tensor([1.5, -0.7, 2.0])
    straight = field.descriptor(field.encode(points), where)
    turned = field.descriptor(field.encode(points @ turn.T + shift), where @ turn.T + shift)
    assert (straight - turned).abs().max() < 1e-4
    assert straight.std(1).mean() > 1e-3  # and they are no constants


def test_mirrored_object_gives_mirrored_field(random_field: Field) -> None:
    points, flip = cloud(), torch.tensor([-1.0, 1.0, 1.0])
    where = queries(points)
    straight = random_field.descriptor(random_field.encode(points), where)
    mirrored = random_field.descriptor(random_field.encode(points * flip), where * flip)
    assert (straight - mirrored).abs().max() < 1e-4


def test_size_matters(random_field: Field) -> None:
    """Objects keep their metres: a chair of half the size has another field."""
    points = cloud()
    where = queries(points)
    whole = random_field.descriptor(random_field.encode(points), where)
    small = random_field.descriptor(random_field.encode(points * 0.5), where * 0.5)
    assert (whole - small).abs().max() > 1e-3


def test_descriptors_are_unit_vectors_of_the_stated_length(random_field: Field) -> None:
    points = cloud()
    found = random_field.descriptor(random_field.encode(points), queries(points))
    assert found.shape == (1, 200, random_field.config.descriptor)
    assert torch.allclose(found.norm(dim=-1), torch.ones(1, 200), atol=1e-5)


def test_gradient_of_queries_matches_finite_differences(random_field: Field) -> None:
    field = Field(random_field.config)
    field.load_state_dict(random_field.state_dict())
    field.double().requires_grad_(False)
    points = cloud().double()
    latent = field.encode(points)
    where = queries(points.float(), 20).double().requires_grad_()
    assert torch.autograd.gradcheck(lambda x: field.occupancy(latent, x), (where,), eps=1e-6, atol=1e-5)
    field.descriptor(latent, where).square().sum(-1).sum().backward()
    assert all(parameter.grad is None for parameter in field.parameters())


def test_batch_does_not_mix_objects(random_field: Field) -> None:
    first, second = cloud(seed=1), cloud(seed=2)
    where = queries(first)
    alone = random_field.descriptor(random_field.encode(first), where)
    both = random_field.encode(torch.cat([first, second]))
    assert torch.allclose(random_field.descriptor(both, where.expand(2, -1, -1))[:1], alone, atol=1e-5)
    assert torch.allclose(random_field.descriptor(both.pick(torch.tensor([0])), where), alone, atol=1e-5)


def test_expanded_latent_serves_many_starts(random_field: Field) -> None:
    points = cloud()
    latent = random_field.encode(points)
    starts = torch.stack([queries(points)[0], queries(points)[0] + 0.1])
    many = random_field.descriptor(latent.expand(2), starts)
    assert torch.allclose(many[1:], random_field.descriptor(latent, starts[1:]), atol=1e-5)
    with pytest.raises(ValueError, match="one object"):
        latent.expand(2).expand(3)


def test_saved_field_answers_the_same(random_field: Field, tmp_path: Path) -> None:
    random_field.save(tmp_path / "field.safetensors")
    loaded = Field.load(tmp_path / "field.safetensors")
    points = cloud()
    where = queries(points)
    expected = random_field.descriptor(random_field.encode(points), where)
    assert torch.equal(loaded.descriptor(loaded.encode(points), where), expected)
    assert not any(parameter.requires_grad for parameter in loaded.parameters())


@pytest.mark.parametrize("count", [500, 2000])
def test_shipped_field_knows_inside_from_outside(shipped_field: Field, count: int) -> None:
    """On sofas never trained on, the occupancy is right at 90 % of ordinary points."""
    right = []
    for seed in range(1_000_000, 1_000_003):
        piece = generate("sofa", seed)
        points = torch.from_numpy(piece.sample_surface(count, seed=0)[0].astype(np.float32))[None]
        where = queries(points, 1000)
        predicted = shipped_field.occupancy(shipped_field.encode(points), where)[0] > 0
        right.append(np.mean(predicted.numpy() == piece.occupancy(where[0].numpy().astype(np.float64))))
    assert np.mean(right) > 0.9


def test_shipped_field_tells_front_from_back(shipped_field: Field) -> None:
    """Half a metre in front of and behind unseen chairs' seats: the place head says which is which."""
    right = []
    for seed in range(1_000_010, 1_000_020):
        piece = generate("chair", seed)
        points = torch.from_numpy(piece.sample_surface(1000, seed=0)[0].astype(np.float32))[None]
        where = torch.from_numpy((piece.seats[0] + [[0, 0.1, 0.4], [0, 0.1, -0.4]]).astype(np.float32))[None]
        front, back = shipped_field.answer(shipped_field.encode(points), where).place[0, :, 2]
        right.append(bool(front > back))
    assert np.mean(right) >= 0.9
