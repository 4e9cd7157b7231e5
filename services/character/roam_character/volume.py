"""Where an object's matter is, for bodies to keep out of: signed distance on a coarse grid, small enough to send.

Distances are whole steps of 2.5 mm in one byte, clipped at 32 cm: farther away nothing touches.
"""

import hashlib
import struct
import zlib
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from roam_character.distance import DistanceGrid, turn_about_y

STEP = 0.0025  # [m] of distance
MOST_NODES = 200_000
_HEAD = struct.Struct("<3f2d3I")  # origin, pitch, yaw, nodes


@dataclass(frozen=True, eq=False)
class Volume:
    """Signed distance to an object at the nodes of a grid, negative inside."""

    origin: npt.NDArray[np.float32]  # [3] node (0, 0, 0) in the world [m]
    pitch: float  # node spacing [m]
    yaw: float  # by which the grid's axes are turned about +Y [rad]
    values: npt.NDArray[np.int8]  # [X, Y, Z] in steps of 2.5 mm

    def __post_init__(self) -> None:
        """ValueError when it cannot be a volume."""
        numbers = [*self.origin, self.pitch, self.yaw]
        if self.origin.shape != (3,) or not np.isfinite(numbers).all() or not 1e-3 <= self.pitch <= 1.0:
            raise ValueError("a volume needs an origin of three finite numbers and a pitch of 1 mm to 1 m")
        if self.values.ndim != 3 or min(self.values.shape) < 2 or self.values.size > MOST_NODES:
            raise ValueError(f"a volume has at least 2 nodes along each axis and at most {MOST_NODES:,} in all")

    def moved(self, offset: npt.NDArray[np.floating]) -> "Volume":
        """The same object elsewhere, `offset` [3] [m]."""
        return replace(self, origin=(self.origin + offset).astype(np.float32))

    @cached_property
    def grid(self) -> DistanceGrid:
        """The same distances in metres, to be looked up between nodes."""
        origin = self.origin.astype(np.float64) @ turn_about_y(self.yaw)
        return DistanceGrid(origin, self.pitch, self.values.astype(np.float32) * np.float32(STEP), self.yaw)

    @cached_property
    def packed(self) -> bytes:
        """All of it, the values compressed."""
        head = _HEAD.pack(*self.origin, self.pitch, self.yaw, *self.values.shape)
        return head + zlib.compress(self.values.tobytes(), 6)

    @cached_property
    def digest(self) -> str:
        """Names the volume by all of its numbers: equal volumes have equal digests."""
        return hashlib.sha256(self.packed).hexdigest()[:32]

    @staticmethod
    def unpacked(data: bytes) -> "Volume":
        """What `packed` told, exactly. ValueError when it is something else."""
        try:
            x, y, z, pitch, yaw, *size = _HEAD.unpack_from(data)
            values = np.frombuffer(zlib.decompress(data[_HEAD.size :]), np.int8).reshape(size)
        except (struct.error, zlib.error) as error:
            raise ValueError(f"not a packed volume: {error}") from error
        return Volume(np.array([x, y, z], np.float32), pitch, yaw, values)
