"""Between the protocol's messages and this service's own types."""

from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp
from roam.v1 import motion_pb2, skeleton_pb2
from roam_character.pose import Pose
from roam_character.skeleton import Skeleton
from roam_character.volume import Volume
from roam_character.wire import pack_float32, pack_int16, unpack_float32
from roam_serving.errors import INVALID_ARGUMENT, ServiceError
from roam_serving.skeletons import SKELETON_NOT_FOUND
from shapely.geometry import Polygon

from roam_motion.animation.state import FRAME_RATE
from roam_motion.animator import Goal, Idle, Steer
from roam_motion.control.paths import Outline
from roam_motion.errors import GOAL_INVALID
from roam_motion.session.session import ControlChange, FrameRecord, Session
from roam_motion.session.stream import FrameStream, StreamOptions, StreamStart

CONTACTS = ("leftFoot", "leftToes", "rightFoot", "rightToes")
ACTIONS = ("idle", "walk", "sit", "lie")  # Action's value - 1
_FASTEST = 10.0  # [m/s]; anything above is a unit error
_FARTHEST = 1e4  # [m] from the origin
_MOST_OBSTACLES, _MOST_CORNERS = 64, 128  # of a goal, of an outline


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


def header_message(stream: FrameStream, start: StreamStart, skeleton: skeleton_pb2.Skeleton) -> motion_pb2.StreamHeader:
    """The first message of a stream; the skeleton shrinks to its id when the reader has it."""
    session, options = stream.session, stream.options
    if options.known_skeleton_id == skeleton.id:
        skeleton = skeleton_pb2.Skeleton(id=skeleton.id)
    return motion_pb2.StreamHeader(
        session=session.name,
        skeleton=skeleton,
        rotation_encoding=options.encoding,  # type: ignore[arg-type]  # an enum's number
        frame_rate=FRAME_RATE,
        first_sequence=start.first_sequence,
        discontinuity=start.discontinuity,
        contact_joints=[session.skeleton.index(name) for name in CONTACTS],
        resume_token=session.record.resume_token,
        last_control_id=session.last_control_id,
        exact=session.exact,
        pacing=options.pacing,  # type: ignore[arg-type]
        stream=stream.id,
    )


def frame_message(record: FrameRecord, session: Session, options: StreamOptions) -> motion_pb2.AnimateResponse:
    """A frame packed as the stream wants it; packed once for all readers that want the same."""
    key = (options.encoding, options.joint_positions)
    if key not in record.packed:
        record.packed[key] = motion_pb2.AnimateResponse(frame=pack_frame(record, session.floor_height, options))
    return record.packed[key]


def pack_frame(record: FrameRecord, floor_height: float, options: StreamOptions) -> motion_pb2.Frame:
    """A frame as the protocol has it; the character walks at 0, the floor is at `floor_height` [m]."""
    data = record.data
    root = data.root.copy()
    root[1] += floor_height
    snorm16 = options.encoding == motion_pb2.ROTATION_ENCODING_SNORM16
    frame = motion_pb2.Frame(
        sequence=record.sequence,
        time=record.sequence / FRAME_RATE,
        root=pack_float32(root),
        rotations=pack_int16(data.snorm16) if snorm16 else pack_float32(data.rotations),
        contacts=int(np.packbits(data.contacts, bitorder="little")[0]),
        action=ACTIONS.index(data.action) + 1,  # type: ignore[arg-type]
        goal_distance=data.goal_distance,
    )
    if options.joint_positions:
        frame.joint_positions = pack_float32(data.positions + np.array([0, floor_height, 0], np.float32))
    return frame


def pose_of(message: skeleton_pb2.Pose, skeleton: Skeleton, *, field: str) -> Pose:
    """A pose of `skeleton`; GOAL_INVALID or SKELETON_NOT_FOUND when the bytes do not fit it."""
    if message.skeleton_id not in ("", skeleton.id):
        detail = f"the session animates {skeleton.id}, the pose is of {message.skeleton_id}"
        raise ServiceError(SKELETON_NOT_FOUND, detail, field=f"{field}.skeleton_id")
    try:
        position = unpack_float32(message.root_position, (3,))
        rotations = unpack_float32(message.rotations, (skeleton.joint_count, 4))
        pose = Pose(skeleton, position, rotations)
    except ValueError as error:
        raise ServiceError(GOAL_INVALID, f"{field}: {error}", field=field) from error
    lengths = np.linalg.norm(rotations, axis=-1, keepdims=True)
    if np.abs(lengths - 1).max() > 0.01:
        raise ServiceError(GOAL_INVALID, f"{field}.rotations are not unit quaternions", field=f"{field}.rotations")
    return Pose(skeleton, pose.root_position, (rotations / lengths).astype(np.float32))


def control_change(message: motion_pb2.ControlInput, session: Session) -> ControlChange:
    """What a control asks for, checked."""
    kind = message.WhichOneof("input")
    if kind == "steer":
        return ControlChange(intent=_steer(message.steer))
    if kind == "goal":
        return ControlChange(intent=_goal(message.goal, session), goal_name=message.goal.goal_pose)
    if kind == "playback":
        return ControlChange(paused=message.playback.paused)
    raise ServiceError(INVALID_ARGUMENT, "a control needs one of steer, goal or playback", field="control.input")


def _steer(message: motion_pb2.Steer) -> Steer | Idle:
    velocity = np.array([message.velocity_x, message.velocity_z], np.float32)
    facing = _direction(message.facing, "control.steer.facing") if message.HasField("facing") else None
    if not np.isfinite(velocity).all() or np.linalg.norm(velocity) > _FASTEST:
        detail = f"velocity must be finite and at most {_FASTEST:g} m/s"
        raise ServiceError(INVALID_ARGUMENT, detail, field="control.steer.velocity_x")
    if message.action not in (
        skeleton_pb2.ACTION_UNSPECIFIED,
        skeleton_pb2.ACTION_IDLE,
        skeleton_pb2.ACTION_WALK,
    ):
        detail = "steering can ask for IDLE or WALK; send a goal to sit or lie"
        raise ServiceError(INVALID_ARGUMENT, detail, field="control.steer.action")
    still = not velocity.any() and facing is None
    if message.action == skeleton_pb2.ACTION_IDLE or still:
        return Idle()
    return Steer(velocity, facing)


def _goal(message: motion_pb2.Goal, session: Session) -> Goal:
    if message.action not in (skeleton_pb2.ACTION_SIT, skeleton_pb2.ACTION_LIE):
        raise ServiceError(GOAL_INVALID, "action must be SIT or LIE", field="control.goal.action")
    if not message.HasField("pose"):
        detail = "pose is missing; names of goal poses are not looked up, send the pose itself"
        raise ServiceError(GOAL_INVALID, detail, field="control.goal.pose")
    pose = pose_of(message.pose, session.skeleton, field="control.goal.pose")
    down = np.array([0, -session.floor_height, 0], np.float32)
    approach = _direction(message.approach, "control.goal.approach") if message.HasField("approach") else None
    volume = _volume(message.volume).moved(down) if message.HasField("volume") else None
    return Goal(pose.moved(down), ACTIONS[message.action - 1], approach, _obstacles(message.obstacles), volume)


def _volume(message: skeleton_pb2.Volume) -> Volume:
    """The furniture, checked."""
    field = "control.goal.volume"
    if len(message.size) != 3 or np.prod([float(n) for n in message.size]) != len(message.values):
        detail = f"size must be three node counts, values one byte a node; {len(message.values)} bytes are given"
        raise ServiceError(GOAL_INVALID, detail, field=field)
    values = np.frombuffer(message.values, np.int8).reshape(tuple(message.size))
    try:
        return Volume(np.array(message.origin, np.float32), message.pitch, message.yaw, values)
    except ValueError as error:
        raise ServiceError(GOAL_INVALID, str(error), field=field) from error


def _obstacles(messages: Sequence[skeleton_pb2.Outline]) -> tuple[Outline, ...]:
    """Outlines of furniture, checked."""
    field = "control.goal.obstacles"
    if len(messages) > _MOST_OBSTACLES:
        raise ServiceError(GOAL_INVALID, f"at most {_MOST_OBSTACLES} outlines, not {len(messages)}", field=field)
    return tuple(_outline(message.corners, f"{field}[{number}]") for number, message in enumerate(messages))


def _outline(corners: Sequence[float], field: str) -> Outline:
    if len(corners) % 2 or not 6 <= len(corners) <= 2 * _MOST_CORNERS:
        detail = f"an outline is x, z of 3 to {_MOST_CORNERS} corners; {len(corners)} numbers are given"
        raise ServiceError(GOAL_INVALID, detail, field=field)
    outline = tuple(zip(corners[::2], corners[1::2], strict=True))
    if not np.isfinite(outline).all() or np.abs(outline).max() > _FARTHEST or not Polygon(outline).is_valid:
        detail = "an outline's corners must be finite, in metres, and its sides must not cross"
        raise ServiceError(GOAL_INVALID, detail, field=field)
    return outline


def _direction(yaw: float, field: str) -> np.ndarray:
    """The direction (x, z) of a heading."""
    if not np.isfinite(yaw):
        raise ServiceError(INVALID_ARGUMENT, "must be a finite angle in radians", field=field)
    return np.array([np.sin(yaw), np.cos(yaw)], np.float32)


def stream_options(message: motion_pb2.Open, *, burst_frames: int, ack_window: int) -> StreamOptions:
    """The stream's options; the first encoding that this server knows is taken."""
    known = (motion_pb2.ROTATION_ENCODING_FLOAT32, motion_pb2.ROTATION_ENCODING_SNORM16)
    encoding = next((e for e in message.rotation_encodings if e in known), motion_pb2.ROTATION_ENCODING_FLOAT32)
    pacing = message.pacing or motion_pb2.PACING_REALTIME
    if pacing not in motion_pb2.Pacing.values():
        raise ServiceError(INVALID_ARGUMENT, f"pacing {pacing} is not known", field="open.pacing")
    return StreamOptions(
        pacing=pacing,
        after_sequence=message.after_sequence,
        resume_token=message.resume_token,
        encoding=encoding,
        known_skeleton_id=message.known_skeleton_id,
        credit=message.credit,
        joint_positions=message.joint_positions,
        burst_frames=burst_frames,
        ack_window=ack_window,
    )
