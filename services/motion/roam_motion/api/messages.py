"""Between the protocol's messages and this service's own types: the only place that knows both."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp
from roam.v1 import motion_pb2, skeleton_pb2
from roam_character.pose import Pose
from roam_character.skeleton import Skeleton
from roam_character.wire import pack_float32, pack_int16, unpack_float32
from roam_serving.errors import INVALID_ARGUMENT, ServiceError

from roam_motion.actions import ACTIONS, IDLE, WALK, action_numbered
from roam_motion.animation.figure import CONTACT_JOINTS
from roam_motion.animation.state import FRAME_RATE
from roam_motion.api import validation
from roam_motion.api.deltas import MOST_BEFORE, pack_deltas
from roam_motion.control.intent import Goal, Idle, Steer
from roam_motion.errors import GOAL_INVALID
from roam_motion.session.records import ControlChange, ControlRequest, Event, SessionRequest
from roam_motion.session.session import FrameRecord, Session
from roam_motion.session.stream import FrameStream, Item, Pacing, StreamOptions, StreamStart

_DELTA16 = motion_pb2.ROTATION_ENCODING_DELTA16
_ENCODINGS = (motion_pb2.ROTATION_ENCODING_FLOAT32, motion_pb2.ROTATION_ENCODING_SNORM16, _DELTA16)


@dataclass(frozen=True)
class FrameFormat:
    """How a reader wants its frames packed."""

    encoding: int = motion_pb2.ROTATION_ENCODING_FLOAT32
    joint_positions: bool = False
    seen: int = 0  # how many of the frames just before it the reader has, as far as its encoding looks back


class Following:
    """How the frames of one stream are packed: which of those before each its reader has seen."""

    def __init__(self, frame_format: FrameFormat) -> None:
        self.format = frame_format
        self._last, self._unbroken = -1, 0  # the sequence sent last, and how many were sent without a gap before it

    def of(self, record: FrameRecord) -> FrameFormat:
        """The format of the next frame that is sent."""
        if self.format.encoding != _DELTA16:
            return self.format
        self._unbroken = self._unbroken + 1 if record.sequence == self._last + 1 else 0
        self._last = record.sequence
        return replace(self.format, seen=min(self._unbroken, MOST_BEFORE, len(record.before)))


def timestamp(seconds: float) -> Timestamp:
    """Seconds since 1970 as a message."""
    message = Timestamp()
    message.FromDatetime(datetime.fromtimestamp(seconds, UTC))
    return message


def session_message(session: Session) -> motion_pb2.Session:
    """What GetSession tells."""
    return motion_pb2.Session(
        name=session.name,
        skeleton_id=session.skeleton.id,
        create_time=timestamp(session.record.create_time),
        expire_time=timestamp(session.expire_time),
        last_sequence=session.sequence,
        frame_rate=FRAME_RATE,
        floor_height=session.floor_height,
        stream_count=len(session.streams),
    )


def response(
    stream: FrameStream, item: Item, following: Following, skeleton: skeleton_pb2.Skeleton
) -> motion_pb2.AnimateResponse:
    """An item of a stream as the message that carries it; `skeleton` as the header tells it."""
    if isinstance(item, FrameRecord):
        return frame_message(item, stream.session.floor_height, following.of(item))
    if isinstance(item, StreamStart):
        return motion_pb2.AnimateResponse(header=_header_message(stream, item, following.format, skeleton))
    return motion_pb2.AnimateResponse(event=_event_message(item))


def known_skeleton(skeleton: skeleton_pb2.Skeleton, known_id: str) -> skeleton_pb2.Skeleton:
    """A header's skeleton, only its id where the reader has it already."""
    return skeleton_pb2.Skeleton(id=skeleton.id) if known_id == skeleton.id else skeleton


def _header_message(
    stream: FrameStream, start: StreamStart, frame_format: FrameFormat, skeleton: skeleton_pb2.Skeleton
) -> motion_pb2.StreamHeader:
    session = stream.session
    return motion_pb2.StreamHeader(
        session=session.name,
        skeleton=skeleton,
        rotation_encoding=frame_format.encoding,  # type: ignore[arg-type]  # an enum's number
        frame_rate=FRAME_RATE,
        first_sequence=start.first_sequence,
        discontinuity=start.discontinuity,
        contact_joints=[session.skeleton.index(name) for name in CONTACT_JOINTS],
        resume_token=session.record.resume_token,
        last_control_id=session.last_control_id,
        exact=session.exact,
        pacing=motion_pb2.Pacing.Value(f"PACING_{stream.options.pacing.name}"),
        stream=stream.id,
    )


def _event_message(event: Event) -> motion_pb2.SessionEvent:
    message = motion_pb2.SessionEvent(
        type=motion_pb2.EventType.Value(f"EVENT_TYPE_{event.kind.name}"),
        sequence=event.sequence,
        message=event.message,
        reason=event.reason,
        control_id=event.control_id,
        goal_pose=event.goal_pose,
        skipped_count=event.skipped_count,
    )
    if event.reconnect_within is not None:
        message.reconnect_within.FromSeconds(event.reconnect_within)
    return message


def frame_message(record: FrameRecord, floor_height: float, frame_format: FrameFormat) -> motion_pb2.AnimateResponse:
    """A frame packed as the reader wants it; packed once for all readers that want the same."""
    if frame_format not in record.packed:
        frame = pack_frame(record, floor_height, frame_format)
        record.packed[frame_format] = motion_pb2.AnimateResponse(frame=frame)
    packed: motion_pb2.AnimateResponse = record.packed[frame_format]
    return packed


def pack_frame(record: FrameRecord, floor_height: float, frame_format: FrameFormat) -> motion_pb2.Frame:
    """A frame as the protocol has it; the character walks at 0, the floor is at `floor_height` [m]."""
    data = record.data
    root = data.root.copy()
    root[1] += floor_height
    short = frame_format.encoding == _DELTA16
    frame = motion_pb2.Frame(
        sequence=record.sequence,
        time=0.0 if short else record.sequence / FRAME_RATE,
        root=pack_float32(root[:3] if short else root),
        rotations=_rotations(record, frame_format),
        contacts=int(np.packbits(data.contacts, bitorder="little")[0]),
        action=ACTIONS[data.action].number,  # type: ignore[arg-type]  # an enum's number
        goal_distance=data.goal_distance,
    )
    if frame_format.joint_positions:
        frame.joint_positions = pack_float32(data.positions + np.array([0, floor_height, 0], np.float32))
    return frame


def _rotations(record: FrameRecord, frame_format: FrameFormat) -> bytes:
    if frame_format.encoding == _DELTA16:
        return pack_deltas(record.data.snorm16, [frame.snorm16 for frame in record.before[: frame_format.seen]])
    if frame_format.encoding == motion_pb2.ROTATION_ENCODING_SNORM16:
        return pack_int16(record.data.snorm16)
    return pack_float32(record.data.rotations)


def pose_of(message: skeleton_pb2.Pose, skeleton: Skeleton, *, field: str) -> Pose:
    """A pose of `skeleton`; GOAL_INVALID or SKELETON_NOT_FOUND when the bytes do not fit it."""
    try:
        position = unpack_float32(message.root_position, (3,))
        rotations = unpack_float32(message.rotations, (-1, 4))
    except ValueError as error:
        raise ServiceError(GOAL_INVALID, f"{field}: {error}", field=field) from error
    return validation.pose(skeleton, message.skeleton_id, position, rotations, field=field)


def session_request(message: motion_pb2.CreateSessionRequest, skeleton: Skeleton) -> SessionRequest:
    """What a new session is asked to be, checked."""
    if message.WhichOneof("start") == "start_pose":
        pose = pose_of(message.start_pose, skeleton, field="start_pose")
        position, yaw = (float(pose.root_position[0]), float(pose.root_position[2])), pose.yaw()
    else:
        place = message.start_placement
        x, z = (validation.finite(getattr(place, name), f"start_placement.{name}") for name in ("x", "z"))
        position, yaw = (x, z), validation.finite(place.yaw, "start_placement.yaw")
    idle_timeout = message.idle_timeout.ToMilliseconds() / 1000 if message.HasField("idle_timeout") else None
    return SessionRequest(
        request_id=message.request_id,
        position=position,
        yaw=yaw,
        seed=message.seed,
        idle_timeout=idle_timeout,
        floor_height=validation.finite(message.floor_height, "floor_height"),
        skeleton_id=message.skeleton_id,
    )


def control_request(message: motion_pb2.ControlInput, skeleton: Skeleton) -> ControlRequest:
    """What a control asks for, checked; INVALID_ARGUMENT or GOAL_INVALID name the field that is wrong."""
    return ControlRequest(validation.control_id(message.control_id), _change(message, skeleton))


def _change(message: motion_pb2.ControlInput, skeleton: Skeleton) -> ControlChange:
    kind = message.WhichOneof("input")
    if kind == "steer":
        return ControlChange(_steer(message.steer))
    if kind == "goal":
        name = validation.short(message.goal.goal_pose, "control.goal.goal_pose")
        return ControlChange(_goal(message.goal, skeleton), name)
    if kind == "playback":
        return ControlChange(paused=message.playback.paused)
    raise ServiceError(INVALID_ARGUMENT, "a control needs one of steer, goal or playback", field="control.input")


def _steer(message: motion_pb2.Steer) -> Steer | Idle:
    if message.action not in (skeleton_pb2.ACTION_UNSPECIFIED, IDLE.number, WALK.number):
        detail = "steering can ask for IDLE or WALK; send a goal for any other action"
        raise ServiceError(INVALID_ARGUMENT, detail, field="control.steer.action")
    facing = message.facing if message.HasField("facing") else None
    velocity = message.velocity_x, message.velocity_z
    return validation.steer(velocity, facing, _point(message, "control.steer"), stand=message.action == IDLE.number)


def _point(message: motion_pb2.Steer | motion_pb2.Goal, field: str) -> np.ndarray | None:
    place = message.look_at
    return validation.point([place.x, place.y, place.z], f"{field}.look_at") if message.HasField("look_at") else None


def _goal(message: motion_pb2.Goal, skeleton: Skeleton) -> Goal:
    action = validation.goal_action(action_numbered(message.action))
    if not message.HasField("pose"):
        detail = "pose is missing; names of goal poses are not looked up, send the pose itself"
        raise ServiceError(GOAL_INVALID, detail, field="control.goal.pose")
    sent = message.volume
    return Goal(
        pose=pose_of(message.pose, skeleton, field="control.goal.pose"),
        action=action.name,
        approach=validation.direction(message.approach, "control.goal.approach")
        if message.HasField("approach")
        else None,
        obstacles=validation.obstacles([outline.corners for outline in message.obstacles]),
        volume=validation.volume(sent.origin, sent.pitch, sent.yaw, sent.size, sent.values)
        if message.HasField("volume")
        else None,
        look_at=_point(message, "control.goal"),
    )


def stream_options(message: motion_pb2.Open) -> StreamOptions:
    """What the reader asks of its stream; INVALID_ARGUMENT for a pacing that is not known."""
    number = message.pacing or motion_pb2.PACING_REALTIME
    if number not in motion_pb2.Pacing.values():
        raise ServiceError(INVALID_ARGUMENT, f"pacing {number} is not known", field="open.pacing")
    return StreamOptions(
        pacing=Pacing[motion_pb2.Pacing.Name(number).removeprefix("PACING_")],
        after_sequence=message.after_sequence,
        resume_token=message.resume_token,
        credit=message.credit,
    )


def frame_format(message: motion_pb2.Open) -> FrameFormat:
    """How the reader wants its frames; the first encoding that this server knows is taken."""
    encoding = next((e for e in message.rotation_encodings if e in _ENCODINGS), motion_pb2.ROTATION_ENCODING_FLOAT32)
    return FrameFormat(encoding, message.joint_positions)
