"""Elementary functions whose bits do not depend on where in a batch a number stands; and that nothing else is used."""

import ast
from pathlib import Path

import pytest
import roam_motion
import torch
from roam_character.tensors import elementary

pytestmark = pytest.mark.equal_bits

ROOT = Path(roam_motion.__file__).parent
# What a step computes of numbers of a whole batch, but for the network, which is asked in sizes that are tried.
STEP = [*sorted((ROOT / "animation").glob("*.py")), ROOT / "graphs.py", ROOT / "models" / "lnsm" / "features.py"]
ROUNDED_FREELY = {
    *(
        "acos",
        "acosh",
        "arccos",
        "arcsin",
        "arctan",
        "arctan2",
        "asin",
        "asinh",
        "atan",
        "atan2",
        "atanh",
        "cos",
        "cosh",
    ),
    *("elu", "erf", "exp", "exp2", "expm1", "log1p", "log_softmax", "logsumexp", "pow", "rsqrt", "sigmoid", "sin"),
    *("sinc", "sinh", "softmax", "softplus", "tan", "tanh"),
}
UNARY = {
    "sine": torch.sin,
    "cosine": torch.cos,
    "arccosine": torch.acos,
    "exponential": torch.exp,
    "sigmoid": torch.sigmoid,
    "sinc": torch.sinc,
}


def numbers(*shape):
    return 2 * torch.rand(*shape, generator=torch.Generator().manual_seed(3)) - 1


@pytest.mark.parametrize("name", UNARY)
def test_they_are_what_they_are_called(name):
    x = numbers(7, 3)
    torch.testing.assert_close(getattr(elementary, name)(x), UNARY[name](x.double()).float(), atol=1e-6, rtol=1e-6)


def test_an_angle_has_its_quadrant():
    y, x = torch.tensor([0.0, 1.0, 0.0, -1.0, 1.0]), torch.tensor([1.0, 0.0, -1.0, 0.0, -1.0])
    torch.testing.assert_close(elementary.arctangent(y, x), torch.atan2(y.double(), x.double()).float())


@pytest.mark.parametrize("name", [*UNARY, "arctangent"])
def test_a_number_has_the_same_bits_wherever_it_stands(name):
    function = getattr(elementary, name)
    inputs = [numbers(70, 2), numbers(70, 2).flip(0)][: 2 if name == "arctangent" else 1]
    whole = function(*inputs)
    for count in range(1, 40):
        part = function(*(x[count : 2 * count - count // 2] for x in inputs))
        assert torch.equal(part, whole[count : 2 * count - count // 2]), count


def test_a_step_uses_no_others():
    used = {}
    for path in STEP:
        if path.name == "elementary.py":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            owner = node.value if isinstance(node, ast.Attribute) else None
            of_numbers = isinstance(owner, ast.Name) and owner.id in ("math", "np")
            if isinstance(node, ast.Attribute) and node.attr in ROUNDED_FREELY and not of_numbers:
                used[f"{path.name}:{node.lineno}"] = node.attr
    assert used == {}
