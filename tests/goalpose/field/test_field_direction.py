"""The hand-written derivative agrees with autograd's."""

import torch
from roam_goalpose.field.field import direction
from torch.nn import functional


def test_value_and_gradient_agree_with_autograd() -> None:
    generator = torch.Generator().manual_seed(0)
    numbers = torch.randn(2, 5, 7, dtype=torch.float64, generator=generator, requires_grad=True)
    mean, scale = torch.randn(7, dtype=torch.float64, generator=generator), torch.rand(7, dtype=torch.float64) + 0.5
    expected = functional.normalize((numbers - mean) * scale, dim=-1)
    found = direction(numbers, mean, scale)
    assert torch.allclose(found, expected)
    probe = torch.randn_like(expected)
    (wanted,) = torch.autograd.grad((expected * probe).sum(), numbers)
    (given,) = torch.autograd.grad((found * probe).sum(), numbers)
    assert torch.allclose(given, wanted)


def test_input_is_left_alone() -> None:
    numbers = torch.randn(3, 4)
    before = numbers.clone()
    direction(numbers, torch.zeros(4), torch.ones(4))
    assert torch.equal(numbers, before)
