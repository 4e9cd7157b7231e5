"""Graphs of tensor operations that run without Python and without the interpreter's lock.

TorchScript is deprecated, yet what is to follow it needs a C++ compiler on every machine that runs a graph; the version
of torch is pinned.
"""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch import Tensor, nn
from torch.jit._fuser import optimized_execution


def traced(function: Callable[..., Any], *example: Tensor) -> Callable[..., Any]:
    """The operations of one call, for tensors with any number of rows; Python's own branches stay as they fell."""
    with _making():
        graph: Callable[..., Any] = torch.jit.trace(function, example, check_trace=False)
    return graph


def frozen(function: Callable[..., Any], *example: Tensor) -> Callable[..., Any]:
    """The same with all folded that does not depend on the tensors; no other graph can call it."""
    with _making():
        graph: Callable[..., Any] = torch.jit.freeze(torch.jit.trace(_Held(function), example, check_trace=False))
    return graph


class _Held(nn.Module):
    """A function as a module: nothing else can be frozen."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__()
        self._function = function
        self.eval()

    def forward(self, *tensors: Tensor) -> Any:
        """What the function answers."""
        return self._function(*tensors)


def scripted(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function as it is written, its loops and branches kept; it can be called where a graph is traced."""
    with _making():
        graph: Callable[..., Any] = torch.jit.script(function)
    return graph


@contextmanager
def _making() -> Iterator[None]:
    with torch.inference_mode(False), torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # tracing warns of each shape and constant that it takes for given
        yield


@contextmanager
def running() -> Iterator[None]:
    """Graphs run as they are: optimising costs the first calls a tenth of a second each, and no later one gains."""
    with optimized_execution(False):
        yield
