"""The client for ordinary code. The asyncio twin is `async_client`; keep the two alike."""

from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

import grpc
from roam.v1 import (
    goal_pose_pb2,
    goal_pose_pb2_grpc,
    motion_pb2,
    motion_pb2_grpc,
    server_pb2,
    server_pb2_grpc,
    skeleton_pb2,
    skeleton_pb2_grpc,
)

from roam_client.actions import Action
from roam_client.errors import InternalServerError, server_errors
from roam_client.goal_poses import (
    GoalPose,
    Pose,
    Progress,
    ReferencePose,
    create_reference_request,
    synthesize_request,
)
from roam_client.objects import Object, format_of, upload_requests
from roam_client.pose_wishes import PoseWishes
from roam_client.security import MetadataChannel, Security
from roam_client.server_info import ServerInfo
from roam_client.sessions import Placement, session_request
from roam_client.skeleton import Skeleton, capsules_from_messages
from roam_client.sync_session import Session
from roam_client.transport import CHANNEL_OPTIONS, required

OnProgress = Callable[[Progress], None]


class Client:
    """Both services, or one of them.

        with Client(goalpose="localhost:50051", motion="localhost:50052") as client:
            goal = client.synthesize(client.upload("chair.glb"), reference="chair_sit")
            with client.create_session(floor_height=goal.floor_height) as session:
                motion = session.bake(goal)

    Addresses are gRPC `host:port`. `ca` or `cert` turn TLS on, `api_key` goes with every call: see `security.Security`.
    Every method raises an error of `roam_client.errors`.
    """

    def __init__(
        self,
        *,
        goalpose: str | None = None,
        motion: str | None = None,
        api_key: str | None = None,
        ca: str | Path | None = None,
        cert: tuple[str | Path, str | Path] | None = None,
        credentials: grpc.ChannelCredentials | None = None,
        timeout: float = 30.0,
    ) -> None:
        self._goalpose = goalpose
        self._motion = motion
        self._security = Security(api_key, ca, cert, credentials)
        self._timeout = timeout  # [s] for everything but the optimisation and streams
        self._channels: dict[str, MetadataChannel] = {}
        self._skeletons: dict[str, Skeleton] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connections; sessions live on until they expire."""
        for channel in self._channels.values():
            channel.close()
        self._channels.clear()

    # Goal poses

    def upload(
        self,
        source: str | Path | bytes,
        *,
        format: str | None = None,
        unit: str | None = None,
        up_axis: str | None = None,
        size: float | None = None,
        piece: str | None = None,
    ) -> Object:
        """Puts a furniture file on the server. Bytes need a `format`; unit and up axis are detected when not given.

        `size` is the object's height in metres, which goes before the unit; `piece` is the name or index of the one to
        take from a file of several (`Object.pieces`), the best seat when not given.
        """
        if isinstance(source, bytes):
            data, name = source, format or ""
        else:
            data, name = Path(source).read_bytes(), format or format_of(Path(source))
        target, stub = self._goal_pose_stub()
        with server_errors(target):
            requests = upload_requests(data, format=name, unit=unit, up_axis=up_axis, size=size, piece=piece)
            return Object.from_message(stub.UploadObject(requests, timeout=self._timeout).object)

    def object(self, name: str) -> Object:
        """What the server knows of an uploaded object."""
        target, stub = self._goal_pose_stub()
        with server_errors(target):
            request = goal_pose_pb2.GetObjectRequest(name=name)
            return Object.from_message(stub.GetObject(request, timeout=self._timeout).object)

    def reference_poses(self, *, include_points: bool = False) -> tuple[ReferencePose, ...]:
        """The poses that `synthesize` can adapt."""
        target, stub = self._goal_pose_stub()
        with server_errors(target):
            request = goal_pose_pb2.ListReferencePosesRequest(include_points=include_points)
            response = stub.ListReferencePoses(request, timeout=self._timeout)
        return tuple(ReferencePose.from_message(message) for message in response.reference_poses)

    def create_reference(
        self, object: Object | str, pose: Pose, *, action: Action = Action.SIT, title: str = ""
    ) -> ReferencePose:
        """Makes a pose in the world of an uploaded object a reference; its name serves `synthesize` as `reference`."""
        target, stub = self._goal_pose_stub()
        request = create_reference_request(object, pose, action=action, title=title)
        with server_errors(target):
            response = stub.CreateReferencePose(request, timeout=self._timeout)
        return ReferencePose.from_message(response.reference_pose)

    def synthesize(
        self,
        object: Object | str,
        *,
        reference: str | None = None,
        action: Action = Action.SIT,
        restarts: int = 0,
        seed: int = 0,
        initial_yaw: float | None = None,
        solver: str = "",
        count: int = 1,
        wishes: PoseWishes | None = None,
        timeout: float = 600.0,
        on_progress: OnProgress | None = None,
    ) -> GoalPose:
        """Optimises goal poses on an uploaded object: the best, with `count` - 1 others in `alternatives`."""
        place = self.object(object) if isinstance(object, str) else object
        request = synthesize_request(
            place,
            reference=reference,
            action=action,
            restarts=restarts,
            seed=seed,
            initial_yaw=initial_yaw,
            solver=solver,
            count=count,
            wishes=wishes,
        )
        for answer in self._synthesize(request, timeout):
            if answer.WhichOneof("message") == "goal_pose":
                message = answer.goal_pose
                own = wishes is not None and wishes.skeleton is not None
                skeleton = Skeleton.from_message(message.skeleton) if own else self.skeleton(message.pose.skeleton_id)
                return GoalPose.from_message(message, skeleton=skeleton, object_to_world=place.object_to_world)
            if on_progress is not None:
                on_progress(Progress.from_message(answer.progress))
        raise InternalServerError("the stream ended without a goal pose", reason="NO_RESULT")

    def _synthesize(
        self, request: goal_pose_pb2.SynthesizeRequest, timeout: float
    ) -> Iterator[goal_pose_pb2.SynthesizeResponse]:
        target, stub = self._goal_pose_stub()
        with server_errors(target):
            yield from stub.Synthesize(request, timeout=timeout)

    def skeleton(self, id: str = "") -> Skeleton:
        """A skeleton with its stand-in body, by id or name; the server's default when empty. Cached."""
        if id not in self._skeletons:
            target = self._goalpose or required(self._motion, "goalpose")
            stub = skeleton_pb2_grpc.SkeletonServiceStub(self._channel(target))
            with server_errors(target):
                response = stub.GetSkeleton(skeleton_pb2.GetSkeletonRequest(skeleton=id), timeout=self._timeout)
            body = capsules_from_messages(list(response.body))
            self._skeletons[id] = Skeleton.from_message(response.skeleton, body)
        return self._skeletons[id]

    # Motion

    def create_session(
        self,
        start: Placement | None = None,
        *,
        seed: int = 0,
        floor_height: float = 0.0,
        idle_timeout: float | None = None,
        skeleton_id: str = "",
        request_id: str | None = None,
    ) -> Session:
        """A character standing at `start` (default: the origin, facing +Z). A `request_id` makes a retry safe."""
        target, stub = self._motion_stub()
        request = session_request(
            start,
            seed=seed,
            floor_height=floor_height,
            idle_timeout=idle_timeout,
            skeleton_id=skeleton_id,
            request_id=request_id,
        )
        with server_errors(target):
            message = stub.CreateSession(request, timeout=self._timeout).session
        _, stub = self._motion_stub(message.name)
        return Session(stub, message, target=target, timeout=self._timeout)

    def session(self, name: str) -> Session:
        """A session that exists already."""
        target, stub = self._motion_stub(name)
        with server_errors(target):
            message = stub.GetSession(motion_pb2.GetSessionRequest(name=name), timeout=self._timeout).session
        return Session(stub, message, target=target, timeout=self._timeout)

    # Servers

    def server_info(self, service: str) -> ServerInfo:
        """What a server is and what it accepts; `service` is goalpose or motion."""
        target = required(self._motion if service == "motion" else self._goalpose, service)
        stub = server_pb2_grpc.ServerServiceStub(self._channel(target))
        with server_errors(target):
            return ServerInfo.from_message(stub.GetServerInfo(server_pb2.GetServerInfoRequest(), timeout=self._timeout))

    def _goal_pose_stub(self) -> tuple[str, goal_pose_pb2_grpc.GoalPoseServiceStub]:
        target = required(self._goalpose, "goalpose")
        return target, goal_pose_pb2_grpc.GoalPoseServiceStub(self._channel(target))

    def _motion_stub(self, session: str = "") -> tuple[str, motion_pb2_grpc.MotionServiceStub]:
        target = required(self._motion, "motion")
        channel = self._channel(target)
        if session:  # for gateways, which cannot look into messages: all requests of a session go to one replica
            channel = channel.with_metadata("x-roam-session", session.removeprefix("sessions/"))
        return target, motion_pb2_grpc.MotionServiceStub(channel)

    def _channel(self, target: str) -> MetadataChannel:
        if target not in self._channels:
            self._channels[target] = self._security.channel(grpc, target, CHANNEL_OPTIONS)
        return self._channels[target]
