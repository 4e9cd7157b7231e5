"""Records of B characters as one matrix with a row for every character.

A graph takes and gives one matrix instead of dozens of tensors: whenever Python lets go of a tensor it gives up the
interpreter's lock, and a busy event loop keeps it for milliseconds.
"""

import math
from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

Shapes = Mapping[str, tuple[int, ...]]  # of the fields of one character, in the order of their columns


def row_width(shapes: Shapes) -> int:
    """Numbers of one character."""
    return sum(map(math.prod, shapes.values()))


def split_tensor(rows: Tensor, shapes: Shapes) -> dict[str, Tensor]:
    """The fields [B, …] of rows [B, D], as views."""
    parts = rows.split([math.prod(shape) for shape in shapes.values()], 1)
    fields = zip(shapes.items(), parts, strict=True)
    return {name: part.unflatten(1, shape) if shape else part[:, 0] for (name, shape), part in fields}


def split_array(rows: np.ndarray, shapes: Shapes) -> dict[str, np.ndarray]:
    """The same of an array."""
    ends = np.cumsum([math.prod(shape) for shape in shapes.values()])
    fields = zip(shapes.items(), np.split(rows, ends[:-1], axis=1), strict=True)
    return {name: part.reshape(len(rows), *shape) for (name, shape), part in fields}


def join(fields: Mapping[str, Tensor]) -> Tensor:
    """Rows [B, D] of fields [B, …]."""
    return torch.cat([field.flatten(1) if field.ndim > 1 else field[:, None] for field in fields.values()], 1)
