"""Elementary functions whose bits do not depend on where in a batch a number stands.

torch computes whole vectors of 4 to 16 numbers with one implementation of such a function and what is left at the end
with another one, which rounds otherwise: torch 2.13's `atan2` and `sigmoid` on AVX2 and AVX-512 do, by up to two units
in the last place. Whether a character's numbers are in a whole vector or at the end depends on how many others there
are. So here there is no end: numbers are laid one behind the other and filled up to whole vectors.

Additions, products, quotients, square roots, comparisons need none of this: IEEE 754 leaves them one answer each.
"""

import torch
from torch import Tensor

from roam_character.tensors.torchscript import scripted


def _filled(x: Tensor) -> Tensor:
    """[...] -> [N] with zeros at the end; N a multiple of 64, twice what torch's loops take at a time on AVX-512."""
    flat = x.reshape(-1)
    return torch.constant_pad_nd(flat, [0, -flat.shape[0] % 64])


_fill = scripted(_filled)


def _arctangent(y: Tensor, x: Tensor) -> Tensor:
    return torch.atan2(_fill(y), _fill(x))[: y.numel()].reshape(y.shape)


def _sine(x: Tensor) -> Tensor:
    return torch.sin(_fill(x))[: x.numel()].reshape(x.shape)


def _cosine(x: Tensor) -> Tensor:
    return torch.cos(_fill(x))[: x.numel()].reshape(x.shape)


def _arccosine(x: Tensor) -> Tensor:
    return torch.acos(_fill(x))[: x.numel()].reshape(x.shape)


def _exponential(x: Tensor) -> Tensor:
    return torch.exp(_fill(x))[: x.numel()].reshape(x.shape)


def _sigmoid(x: Tensor) -> Tensor:
    return torch.sigmoid(_fill(x))[: x.numel()].reshape(x.shape)


def _sinc(x: Tensor) -> Tensor:
    return torch.sinc(_fill(x))[: x.numel()].reshape(x.shape)


_ARCTANGENT, _SINE, _COSINE, _ARCCOSINE, _EXPONENTIAL, _SIGMOID, _SINC = (
    scripted(function) for function in (_arctangent, _sine, _cosine, _arccosine, _exponential, _sigmoid, _sinc)
)


def arctangent(y: Tensor, x: Tensor) -> Tensor:
    """The angle [rad] of (x, y), -pi to pi. [...], [...] of one shape -> [...]."""
    angle: Tensor = _ARCTANGENT(y, x)
    return angle


def sine(x: Tensor) -> Tensor:
    """Of angles [rad]. [...] -> [...]."""
    found: Tensor = _SINE(x)
    return found


def cosine(x: Tensor) -> Tensor:
    """Of angles [rad]. [...] -> [...]."""
    found: Tensor = _COSINE(x)
    return found


def arccosine(x: Tensor) -> Tensor:
    """The angle [rad], 0 to pi. [...] -> [...]."""
    angle: Tensor = _ARCCOSINE(x)
    return angle


def exponential(x: Tensor) -> Tensor:
    """e to the power of x. [...] -> [...]."""
    found: Tensor = _EXPONENTIAL(x)
    return found


def sigmoid(x: Tensor) -> Tensor:
    """1 / (1 + exp(-x)). [...] -> [...]."""
    found: Tensor = _SIGMOID(x)
    return found


def sinc(x: Tensor) -> Tensor:
    """sin(pi x) / (pi x), 1 at 0. [...] -> [...]."""
    found: Tensor = _SINC(x)
    return found
