"""Where a body could rest on an object: tops of surfaces with free space above, as starts for the search.

These are only starting points, as the paper's own initial shift of the hip onto the nearest surface is; what they are
worth is for the energy to say.
"""

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from roam_goalpose.objects import Shape

STEP = 0.02  # [m] vertical sampling
HEADROOM = (0.08, 0.16, 0.24, 0.32)  # [m] above a surface, free of the object
LOWEST, HIGHEST = 0.12, 1.15  # [m] above the floor: nobody sits on less or more


def find_places(shape: Shape, *, most: int = 160) -> Tensor:
    """Surface points [K, 3] [m] to try the seat of the body on, at most about `most`, on a horizontal grid."""
    low, high = shape.bounds
    spacing = float(np.clip(np.sqrt((high[0] - low[0]) * (high[2] - low[2]) / most), 0.045, 0.12))
    columns = _columns(low, high, spacing)
    top = min(float(high[1]), shape.floor_height + HIGHEST) + STEP
    heights = torch.arange(top, shape.floor_height + LOWEST, -STEP)
    points = torch.stack(torch.broadcast_tensors(columns[:, None, 0], heights, columns[:, None, 1]), dim=-1)
    d = shape.distance.query(points)  # [columns, heights], downwards
    enter = (d[:, :-1] > 0) & (d[:, 1:] <= 0)
    column, step = torch.nonzero(enter, as_tuple=True)
    before, after = d[column, step], d[column, step + 1]
    surface = points[column, step].clone()
    surface[:, 1] -= STEP * before / (before - after).clamp(min=1e-6)
    above = surface[:, None] + torch.tensor([[0.0, h, 0.0] for h in HEADROOM])
    return surface[(shape.distance.query(above) > 0.02).all(-1)]


def _columns(low: npt.NDArray[np.float64], high: npt.NDArray[np.float64], spacing: float) -> Tensor:
    """Grid over the footprint, symmetric about its middle. -> [K, 2]."""
    axes = []
    for axis in (0, 2):
        count = max(1, int((high[axis] - low[axis]) / spacing))
        middle = (high[axis] + low[axis]) / 2
        axes.append(middle + spacing * (torch.arange(count) - (count - 1) / 2))
    x, z = torch.meshgrid(axes[0].float(), axes[1].float(), indexing="ij")
    return torch.stack([x.reshape(-1), z.reshape(-1)], dim=-1)
