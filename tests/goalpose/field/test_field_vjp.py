"""Descriptors' slopes in closed form: those of autograd, and to the bit the same in any company."""

import pytest
import torch
from roam_goalpose.field import Field, FieldConfig
from roam_goalpose.field.latent import latent_concat
from torch import Tensor


@pytest.fixture(scope="module")
def field() -> Field:
    torch.manual_seed(0)
    made = Field(FieldConfig(anchors=64, channels=16, scalars=16, frame=16, hidden=32))
    for parameter in made.parameters():  # zero-initialised layers would hide mistakes
        torch.nn.init.normal_(parameter, std=0.15) if parameter.ndim > 1 else None
    return made.requires_grad_(False).eval()


def some(*shape: int, seed: int = 0) -> Tensor:
    return 0.4 * torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def test_values_and_slopes_are_those_of_autograd(field: Field) -> None:
    latent, queries = field.encode(some(2, 500, 3)), some(2, 40, 3, seed=1).requires_grad_()
    descriptors = field.descriptor(latent, queries)
    slope = some(*descriptors.shape, seed=2)
    (wanted,) = torch.autograd.grad(descriptors, queries, slope)
    pull = field.linearize(latent, queries.detach())
    torch.testing.assert_close(pull.descriptors, descriptors.detach())
    torch.testing.assert_close(pull.vjp(slope), wanted, atol=1e-5, rtol=1e-3)


@pytest.mark.parametrize("count", [30, 90, 240])
def test_an_object_gets_the_same_bits_in_any_company(field: Field, count: int) -> None:
    latents = [field.encode(some(1, 500, 3, seed=k)) for k in range(4)]
    queries = some(4, count, 3, seed=5)
    together = field.linearize(latent_concat(latents), queries)
    slope = some(*together.descriptors.shape, seed=6)
    forces = together.vjp(slope)
    for k, latent in enumerate(latents):
        alone = field.linearize(latent, queries[k : k + 1])
        assert torch.equal(alone.descriptors[0], together.descriptors[k])
        assert torch.equal(alone.vjp(slope[k : k + 1])[0], forces[k])
