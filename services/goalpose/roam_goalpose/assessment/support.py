"""What holds a sitting body: how high, how wide and how steady, measured on the object's distance grid."""

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from roam_goalpose.assessment.hull import breadth
from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.scene import Target

_CELL, _REACH, _SAG, _SLAT = 0.05, 0.50, 0.08, 0.03  # [m] of the grid that looks for the seat around the hips
_STEP, _GAP = 0.02, 3  # [m] along a way across the seat, and how many steps without a surface end it
_DROP, _RISE = 0.04, 0.08  # [m] below and above the hips' seat where its surface may be: rounded edges, slopes
_WAYS = 12  # across the seat, over half a turn
_FARTHEST = 2.0  # [m] from the object's middle, where it is looked for on the floor
_TOUCH = 0.005  # [m] what is this near to the floor touches it
_SHORT_FOOT, _WIDE_BASE = 0.02, 0.40  # [m]
_SHEET = 0.008  # [m] from a surface: steps of a centimetre downwards shall not miss a thin one


def seat_measures(figure: Figure, target: Target, top: float) -> dict[str, float]:
    """The surface that holds the first pose, whose `top` [m] lies below the hips.

    `seat_height` over the floor; `seat_area` [m^2] level with it in a metre's square about the hips; `seat_breadth`:
    the narrowest way across that surface through the place below the hips, `seat_length` the longest, up to a metre;
    `base_breadth`: the narrowest way across what the object touches the floor with.
    """
    hips = figure.root_position[0]
    breadth, length = _across(hips, target, top)
    return {
        "seat_height": top - target.floor_height,
        "seat_area": _area(hips, target, top),
        "seat_breadth": breadth,
        "seat_length": length,
        "base_breadth": base_breadth(target),
    }


def _area(hips: Tensor, target: Target, top: float) -> float:
    steps = torch.arange(-_REACH, _REACH + 0.5 * _CELL, _CELL)
    drops = torch.arange(_SAG, -_SAG - 0.01, -0.02)
    x, y, z = torch.meshgrid(steps, drops, steps, indexing="ij")
    column = torch.stack([hips[0] + x, top + y, hips[2] + z], dim=-1)
    level = (target.distance.query(column) <= _SLAT).any(1)  # slats and strings with gaps between them too
    return float(level.sum()) * _CELL**2


def _across(hips: Tensor, target: Target, top: float) -> tuple[float, float]:
    """Sum of the ways to both ends [m], in the directions where it is least and most; up to a metre."""
    angles = torch.arange(2 * _WAYS) * (torch.pi / _WAYS)
    steps = torch.arange(_STEP, _REACH + 0.5 * _STEP, _STEP)
    heights = top + torch.arange(_RISE, -_DROP - 0.001, -0.01)
    x = hips[0] + angles.sin()[:, None] * steps
    z = hips[2] + angles.cos()[:, None] * steps
    points = torch.stack(torch.broadcast_tensors(x[..., None], heights, z[..., None]), dim=-1)
    there = (target.distance.query(points) <= _SHEET).any(-1)  # [2 ways, steps]
    missing = torch.nn.functional.pad((~there).float(), (0, _GAP), value=1.0)
    over = missing.unfold(-1, _GAP, 1).amin(-1)[:, : len(steps) + 1] > 0  # a gap too wide begins here
    ways = over.int().argmax(-1) * _STEP
    both = ways[:_WAYS] + ways[_WAYS:]
    return float(both.min()), float(both.max())


def base_breadth(target: Target) -> float:
    """The narrowest way across the hull of what touches the floor [m]; 0 when it touches along a line at most.

    Feet that are a little short count too where they make the base a wide one; what is round is never so wide there.
    """
    wide = _breadth_at(target, _SHORT_FOOT)
    return wide if wide > _WIDE_BASE else _breadth_at(target, _TOUCH)


def _breadth_at(target: Target, reach: float) -> float:
    """The same of what is within `reach` [m] of a plane as high over the floor."""
    narrowest = breadth(_touching(target, reach))
    return narrowest + _STEP if narrowest > 0 else 0.0


def _touching(target: Target, reach: float) -> npt.NDArray[np.float64]:
    """Places `[K, 2]` [m] on the floor, in the object's own axes, on which it stands."""
    steps = torch.arange(-_FARTHEST, _FARTHEST, _STEP)
    x, z = torch.meshgrid(steps, steps, indexing="ij")
    floor = torch.stack([x, torch.full_like(x, target.floor_height + reach), z], dim=-1)
    there = target.distance.query(floor) <= reach
    return torch.stack([x[there], z[there]], dim=-1).double().numpy()
