"""Client of ROAM Services: goal poses and streamed motion, without torch.

    from roam_client import Client

    with Client(goalpose="localhost:50051", motion="localhost:50052") as client:
        goal = client.synthesize(client.upload("chair.glb"), reference="chair_sit")
        with client.create_session(floor_height=goal.floor_height) as session:
            session.bake(goal).save("sit.npz")

`AsyncClient` has the same methods as coroutines.
"""

from roam_client.async_client import AsyncClient
from roam_client.errors import (
    AccessDeniedError,
    ConflictError,
    ConnectionFailedError,
    FieldViolation,
    FormatError,
    InternalServerError,
    InvalidRequestError,
    NotFoundError,
    RequestTimeoutError,
    RoamError,
    ServerError,
    UnavailableError,
    WireError,
)
from roam_client.sessions import controls
from roam_client.sessions.async_session import AsyncSession
from roam_client.sessions.placement import Placement
from roam_client.sessions.sync_session import Session
from roam_client.streams.async_stream import AsyncStream
from roam_client.streams.sync_stream import Stream
from roam_client.sync_client import Client
from roam_client.types.actions import Action
from roam_client.types.frames import Event, EventType, Frame, Header
from roam_client.types.goal_poses import GoalPose, Pose, Progress, ReferencePose
from roam_client.types.motions import Motion
from roam_client.types.objects import Object, Warning
from roam_client.types.pose_quality import BonePenetration, PoseQuality
from roam_client.types.pose_wishes import PoseWishes
from roam_client.types.server_info import ServerInfo
from roam_client.types.skeleton import Capsule, Skeleton, Tip
from roam_client.version import __version__

__all__ = [
    "AccessDeniedError",
    "Action",
    "AsyncClient",
    "AsyncSession",
    "AsyncStream",
    "BonePenetration",
    "Capsule",
    "Client",
    "ConflictError",
    "ConnectionFailedError",
    "Event",
    "EventType",
    "FieldViolation",
    "FormatError",
    "Frame",
    "GoalPose",
    "Header",
    "InternalServerError",
    "InvalidRequestError",
    "Motion",
    "NotFoundError",
    "Object",
    "Placement",
    "Pose",
    "PoseQuality",
    "PoseWishes",
    "Progress",
    "ReferencePose",
    "RequestTimeoutError",
    "RoamError",
    "ServerError",
    "ServerInfo",
    "Session",
    "Skeleton",
    "Stream",
    "Tip",
    "UnavailableError",
    "Warning",
    "WireError",
    "__version__",
    "controls",
]
