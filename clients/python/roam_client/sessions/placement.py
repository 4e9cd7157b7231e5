"""How a motion session begins."""

import uuid
from dataclasses import dataclass

from google.protobuf.duration_pb2 import Duration
from roam.v1 import motion_pb2


@dataclass(frozen=True)
class Placement:
    """A place and heading on the floor."""

    x: float  # world [m]
    z: float  # world [m]
    yaw: float = 0.0  # about +Y [rad]; 0 faces +Z


def session_request(
    start: Placement | None,
    *,
    seed: int,
    floor_height: float,
    idle_timeout: float | None,
    skeleton_id: str,
    request_id: str | None,
) -> motion_pb2.CreateSessionRequest:
    """The request; without a `request_id` a fresh one, so that a transport retry cannot create two characters."""
    timeout = None
    if idle_timeout is not None:
        timeout = Duration()
        timeout.FromMilliseconds(round(idle_timeout * 1000))
    return motion_pb2.CreateSessionRequest(
        request_id=request_id or str(uuid.uuid4()),
        start_placement=motion_pb2.Placement(x=start.x, z=start.z, yaw=start.yaw) if start else None,
        seed=seed,
        idle_timeout=timeout,
        floor_height=floor_height,
        skeleton_id=skeleton_id,
    )
