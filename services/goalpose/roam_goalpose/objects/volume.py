"""An object's distance grid made coarse enough to travel with a goal pose."""

import numpy as np
from roam_character.distance import turn_about_y
from roam_character.volume import STEP, Volume

from roam_goalpose.objects.shape import Shape

_PITCH = 0.04  # [m]: a forearm is 7 cm thick
_NODES = 30_000  # larger furniture gets a coarser grid
_MARGIN = 0.08  # [m] kept around the object, of the distance grid's own


def shape_volume(shape: Shape) -> Volume:
    """What the motion service keeps bodies out of."""
    axes = turn_about_y(shape.distance.yaw)
    own = shape.points @ axes  # in the grid's axes
    low = own.min(0) - _MARGIN
    extents = own.max(0) + _MARGIN - low
    pitch = max(_PITCH, float((np.prod(extents) / _NODES) ** (1 / 3)))
    size = np.ceil(extents / pitch).astype(int) + 1
    nodes = low + pitch * np.stack(np.meshgrid(*(np.arange(n) for n in size), indexing="ij"), -1)
    values = np.clip(np.round(shape.distance.sample(nodes @ axes.T) / STEP), -127, 127).astype(np.int8)
    return Volume((axes @ low).astype(np.float32), pitch, shape.distance.yaw, values)
