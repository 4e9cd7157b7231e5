"""An object brought to its own axes: middle of its footprint at the origin, floor at 0, front along +Z.

What is computed there does not depend on how and where the upload stands: results are turned and moved back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from roam_character.distance import turn_about_y
from roam_character.pose import Pose

from roam_goalpose.objects.shape import Shape


@dataclass(frozen=True, eq=False)
class Placement:
    """From an object's own axes to the world: first turned, then moved."""

    yaw: float  # about +Y [rad]
    offset: npt.NDArray[np.float64]  # [3] [m]

    def to_world(self, pose: Pose) -> Pose:
        """A pose in the object's axes as one in the world."""
        return pose.turned(self.yaw).moved(self.offset)

    def point_to_world(self, points: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
        """Points `[..., 3]` [m] in the object's axes as points in the world."""
        return np.asarray(points, np.float64) @ turn_about_y(self.yaw).T + self.offset

    def point_to_own(self, points: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
        """Points `[..., 3]` [m] in the world as points in the object's axes."""
        return (np.asarray(points, np.float64) - self.offset) @ turn_about_y(self.yaw)


def in_own_axes(shape: Shape) -> tuple[Shape, Placement]:
    """The same object in its own axes, without mesh and normals, and the way back."""
    grid = shape.distance
    axes = turn_about_y(grid.yaw)
    middle = grid.origin + 0.5 * grid.pitch * (np.array(grid.values.shape) - 1)
    home = np.array([middle[0], shape.floor_height, middle[2]])  # in the grid's axes
    placement = Placement(grid.yaw, axes @ home)
    points = placement.point_to_own(shape.points).astype(np.float32)
    own = replace(
        shape,
        points=points,
        normals=None,
        floor_height=0.0,
        bounds=np.stack([points.min(0), points.max(0)]).astype(np.float64),
        distance=replace(grid, origin=grid.origin - home, yaw=0.0),
        front=shape.front @ axes,
        mesh=None,
    )
    return own, placement
