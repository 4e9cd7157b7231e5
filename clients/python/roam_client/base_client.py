"""What both clients are: addresses, channels, and every method as a plan of calls. No input or output."""

from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

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

from roam_client.connection.calls import GOALPOSE, MOTION, Attempts, Call, Plan
from roam_client.connection.security import MetadataChannel, OpensChannels, Security
from roam_client.connection.transport import CHANNEL_OPTIONS, required
from roam_client.errors import InternalServerError, NotFoundError
from roam_client.types.actions import Action
from roam_client.types.goal_poses import (
    GoalPose,
    Pose,
    Progress,
    ReferencePose,
    create_reference_request,
    synthesize_request,
)
from roam_client.types.objects import Object, format_of, upload_requests
from roam_client.types.server_info import ServerInfo
from roam_client.types.skeleton import Skeleton, capsules_from_messages

OnProgress = Callable[[Progress], None]

_POSES = goal_pose_pb2_grpc.GoalPoseServiceStub
_MOTIONS = motion_pb2_grpc.MotionServiceStub
_RETIRED_CHANNELS = 4  # connections given up as silent, kept for streams that still read from them


class BaseClient:
    """Both services, or one of them; see `Client` and `AsyncClient`."""

    _grpc: OpensChannels  # grpc or grpc.aio

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
        self._addresses = {GOALPOSE: goalpose, MOTION: motion}
        self._security = Security(api_key, ca, cert, credentials)
        self._timeout = timeout  # [s] for everything but the optimisation and streams
        self._channels: dict[str, MetadataChannel] = {}
        self._retired: deque[MetadataChannel] = deque()
        self._reached: set[str] = set()
        self._skeletons: dict[str, Skeleton] = {}

    # Channels

    def target(self, service: str) -> str:
        """The address of a service; a RoamError that says which one is missing."""
        return required(self._addresses[service], service)

    def stub(self, kind: type[Any], service: str, session: str = "") -> Any:
        """A generated stub on the connection to a service."""
        target = self.target(service)
        if target not in self._channels:
            self._channels[target] = self._security.channel(self._grpc, target, CHANNEL_OPTIONS)
        channel = self._channels[target]
        if session:  # for gateways, which cannot look into messages: all requests of a session go to one replica
            channel = channel.with_metadata("x-roam-session", session.removeprefix("sessions/"))
        return kind(channel)

    def renew(self, service: str) -> list[MetadataChannel]:
        """Lets the next call open a connection of its own, elsewhere if it can; channels that can be closed by now."""
        old = self._channels.pop(self.target(service), None)
        if old is not None:
            self._retired.append(old)
        return [self._retired.popleft() for _ in range(len(self._retired) - _RETIRED_CHANNELS)]

    def _all_channels(self) -> list[MetadataChannel]:
        """Every channel, for closing; the client forgets them."""
        channels = [*self._channels.values(), *self._retired]
        self._channels.clear()
        self._retired.clear()
        return channels

    def _attempts(self, call: Call) -> Attempts:
        target = self.target(call.service)
        return Attempts(target, call, call.timeout or self._timeout, target in self._reached)

    def _method(self, call: Call, attempts: Attempts) -> Any:
        """The call, started: an answer, something to wait for or to iterate over, as the kind of client has it."""
        method = getattr(self.stub(call.stub, call.service, call.session), call.method)
        request = call.request() if callable(call.request) else call.request
        return method(request, timeout=attempts.seconds)

    # Goal poses

    def _upload(
        self,
        source: str | Path | bytes,
        *,
        format: str | None,
        unit: str | None,
        up_axis: str | None,
        size: float | None,
        piece: str | None,
    ) -> Plan[Object]:
        if isinstance(source, bytes):
            data, name = source, format or ""
        else:
            data, name = Path(source).read_bytes(), format or format_of(Path(source))

        def requests() -> Iterator[goal_pose_pb2.UploadObjectRequest]:
            return upload_requests(data, format=name, unit=unit, up_axis=up_axis, size=size, piece=piece)

        response = yield Call(GOALPOSE, "UploadObject", requests, _POSES)
        return Object.from_message(response.object)

    def _object(self, name: str) -> Plan[Object]:
        response = yield Call(GOALPOSE, "GetObject", goal_pose_pb2.GetObjectRequest(name=name), _POSES)
        return Object.from_message(response.object)

    def _reference_poses(self, *, include_points: bool) -> Plan[tuple[ReferencePose, ...]]:
        request = goal_pose_pb2.ListReferencePosesRequest(include_points=include_points)
        response = yield Call(GOALPOSE, "ListReferencePoses", request, _POSES)
        return tuple(ReferencePose.from_message(message) for message in response.reference_poses)

    def _create_reference(self, object: Object | str, pose: Pose, *, action: Action, title: str) -> Plan[ReferencePose]:
        request = create_reference_request(object, pose, action=action, title=title)
        response = yield Call(GOALPOSE, "CreateReferencePose", request, _POSES)
        return ReferencePose.from_message(response.reference_pose)

    def _synthesize(
        self, object: Object | str, *, timeout: float, on_progress: OnProgress | None, **options: Any
    ) -> Plan[GoalPose]:
        place = (yield from self._object(object)) if isinstance(object, str) else object
        request = synthesize_request(place, **options)

        def is_answer(message: goal_pose_pb2.SynthesizeResponse) -> bool:
            if message.WhichOneof("message") == "goal_pose":
                return True
            if on_progress is not None:
                on_progress(Progress.from_message(message.progress))
            return False

        answer = yield Call(GOALPOSE, "Synthesize", request, _POSES, timeout=timeout, on_message=is_answer)
        if answer is None:
            raise InternalServerError("the stream ended without a goal pose", reason="NO_RESULT")
        message = answer.goal_pose
        if request.HasField("skeleton"):
            skeleton = Skeleton.from_message(message.skeleton)
        else:
            skeleton = yield from self._skeleton(message.pose.skeleton_id)
        return GoalPose.from_message(message, skeleton=skeleton, object_to_world=place.object_to_world)

    def _skeleton(self, id: str) -> Plan[Skeleton]:
        if id not in self._skeletons:
            service = GOALPOSE if self._addresses[GOALPOSE] else MOTION
            required(self._addresses[service], GOALPOSE)
            request = skeleton_pb2.GetSkeletonRequest(skeleton=id)
            response = yield Call(service, "GetSkeleton", request, skeleton_pb2_grpc.SkeletonServiceStub)
            body = capsules_from_messages(list(response.body))
            self._skeletons[id] = Skeleton.from_message(response.skeleton, body)
        return self._skeletons[id]

    # Motion

    def _create_session(self, request: motion_pb2.CreateSessionRequest) -> Plan[motion_pb2.Session]:
        response = yield Call(MOTION, "CreateSession", request, _MOTIONS)
        return response.session

    def _get_session(self, name: str) -> Plan[motion_pb2.Session]:
        response = yield Call(MOTION, "GetSession", motion_pb2.GetSessionRequest(name=name), _MOTIONS, session=name)
        return response.session

    def _delete_session(self, name: str) -> Plan[None]:
        try:
            yield Call(MOTION, "DeleteSession", motion_pb2.DeleteSessionRequest(name=name), _MOTIONS, session=name)
        except NotFoundError:  # gone already, perhaps by an attempt whose answer was lost
            return

    def _control(self, name: str, control: motion_pb2.ControlInput) -> Plan[int]:
        request = motion_pb2.ControlRequest(session=name, control=control)
        response = yield Call(MOTION, "Control", request, _MOTIONS, session=name)
        return int(response.effective_sequence)

    # Servers

    def _server_info(self, service: str) -> Plan[ServerInfo]:
        kind = MOTION if service == MOTION else GOALPOSE
        request = server_pb2.GetServerInfoRequest()
        response = yield Call(kind, "GetServerInfo", request, server_pb2_grpc.ServerServiceStub)
        return ServerInfo.from_message(response)
