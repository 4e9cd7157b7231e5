"""JSON of the motion service: what HTTP takes and gives. Arrays are nested lists; metres, radians, xyzw."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Base64Bytes, BaseModel, ConfigDict, Field
from roam.v1 import motion_pb2, skeleton_pb2
from roam_character.wire import pack_float32

from roam_motion.animation.state import FRAME_RATE
from roam_motion.api.messages import ACTIONS
from roam_motion.session.session import Event, FrameRecord, Session
from roam_motion.session.stream import Item, StreamStart

Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]  # nothing sensible is larger, float32 holds it
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
Quaternion = Annotated[list[Number], Field(min_length=4, max_length=4)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class PoseJson(_Strict):
    """A pose: the `pose` of a goal pose can be sent as it is."""

    skeleton_id: str = Field("", description="empty: the server's default skeleton")
    root_position: Vector = Field(description="world position of the root joint [m]")
    rotations: list[Quaternion] = Field(description="local rotations xyzw, one per joint")

    def message(self) -> skeleton_pb2.Pose:
        """As the protocol tells it."""
        return skeleton_pb2.Pose(
            skeleton_id=self.skeleton_id,
            root_position=pack_float32(np.array(self.root_position)),
            rotations=pack_float32(np.array(self.rotations)),
        )


class PlacementJson(_Strict):
    """A place and heading on the floor."""

    x: Number = Field(0.0, description="world x [m]")
    z: Number = Field(0.0, description="world z [m]")
    yaw: Number = Field(0.0, description="heading about +Y [rad]; 0 faces +Z")


class CreateSessionJson(_Strict):
    """Body of POST /v1/sessions; every field may be left out."""

    request_id: str = Field("", max_length=64, description="the same id again returns the same session")
    start: PlacementJson = PlacementJson()
    seed: int | None = Field(None, ge=0, lt=1 << 64)
    idle_timeout: Number | None = Field(None, gt=0, description="kept this long without a client [s]")
    floor_height: Number = Field(0.0, description="height of the floor [m]")
    skeleton_id: str = ""

    def message(self) -> motion_pb2.CreateSessionRequest:
        """As the protocol tells it."""
        request = motion_pb2.CreateSessionRequest(
            request_id=self.request_id,
            start_placement=motion_pb2.Placement(**self.start.model_dump()),
            seed=self.seed,
            floor_height=self.floor_height,
            skeleton_id=self.skeleton_id,
        )
        if self.idle_timeout is not None:
            request.idle_timeout.FromMilliseconds(round(self.idle_timeout * 1000))
        return request


class SteerJson(_Strict):
    """Steer by hand."""

    velocity: Annotated[list[Number], Field(min_length=2, max_length=2)] = Field(description="world x, z [m/s]")
    facing: Number | None = Field(None, description="heading [rad]; absent: face where it walks")


class VolumeJson(_Strict):
    """The furniture of a goal: the `volume` of a goal pose can be sent as it is."""

    origin: Vector = Field(description="node (0, 0, 0), world x y z [m]")
    pitch: Number = Field(description="distance between nodes [m]")
    yaw: Number = Field(0.0, description="heading of the grid's z axis about +Y [rad]")
    size: Annotated[list[Annotated[int, Field(ge=2, le=100_000)]], Field(min_length=3, max_length=3)]
    values: Base64Bytes = Field(description="int8 [x, y, z]: signed distance in steps of 2.5 mm, negative inside")

    def message(self) -> skeleton_pb2.Volume:
        """As the protocol tells it."""
        return skeleton_pb2.Volume(
            origin=self.origin, pitch=self.pitch, yaw=self.yaw, size=self.size, values=self.values
        )


class GoalJson(_Strict):
    """Head for a goal pose."""

    pose: PoseJson
    action: Literal["sit", "lie"] = "sit"
    goal_pose: str = Field("", description="its name, repeated in events")
    approach: Number | None = Field(None, description="lying: heading from the hips to the open side [rad]")
    obstacles: list[list[tuple[Number, Number]]] = Field(
        [],
        description="what to walk round, the goal's furniture included: corners x, z [m] of outlines",
    )
    volume: VolumeJson | None = Field(None, description="the furniture itself, which arms and legs keep out of")


class PlaybackJson(_Strict):
    """Hold or go on."""

    paused: bool


class ControlJson(_Strict):
    """Body of POST /v1/sessions/{id}/control: one of steer, goal and playback."""

    control_id: int = Field(0, ge=0, lt=1 << 64, description="client-chosen 1, 2, 3, …; 0 takes the next free one")
    steer: SteerJson | None = None
    goal: GoalJson | None = None
    playback: PlaybackJson | None = None

    def message(self) -> motion_pb2.ControlInput:
        """As the protocol tells it; the last intent given wins, as in a protobuf oneof."""
        control = motion_pb2.ControlInput(control_id=self.control_id)
        if self.steer is not None:
            x, z = self.steer.velocity
            control.steer.CopyFrom(motion_pb2.Steer(velocity_x=x, velocity_z=z, facing=self.steer.facing))
        if self.goal is not None:
            action = ACTIONS.index(self.goal.action) + 1
            goal = motion_pb2.Goal(
                goal_pose=self.goal.goal_pose,
                pose=self.goal.pose.message(),
                approach=self.goal.approach,
                obstacles=[skeleton_pb2.Outline(corners=sum(corners, ())) for corners in self.goal.obstacles],
                volume=self.goal.volume.message() if self.goal.volume is not None else None,
            )
            goal.action = action  # type: ignore[assignment]  # an enum's number
            control.goal.CopyFrom(goal)
        if self.playback is not None:
            control.playback.CopyFrom(motion_pb2.Playback(paused=self.playback.paused))
        return control


class SessionJson(BaseModel):
    """A session."""

    name: str = Field(description="sessions/{id}")
    id: str = Field(description="the part behind sessions/, as the addresses take it")
    skeleton_id: str
    create_time: float = Field(description="seconds since 1970")
    expire_time: float = Field(description="when it is reclaimed if nobody connects [seconds since 1970]")
    last_sequence: int
    frame_rate: float
    floor_height: float
    stream_count: int

    @staticmethod
    def of(session: Session) -> "SessionJson":
        """What GET /v1/sessions/{id} tells."""
        return SessionJson(
            name=session.name,
            id=session.name.removeprefix("sessions/"),
            skeleton_id=session.skeleton.id,
            create_time=session.record.create_time,
            expire_time=session.expire_time,
            last_sequence=session.sequence,
            frame_rate=FRAME_RATE,
            floor_height=session.floor_height,
            stream_count=len(session.streams),
        )


class SessionsJson(BaseModel):
    """A page of sessions."""

    sessions: list[SessionJson]
    next_page_token: str = Field(description="empty on the last page")


class ControlledJson(BaseModel):
    """Answer to a control."""

    effective_sequence: int = Field(description="first frame that the control can affect")


def item_json(item: Item, session: Session, *, positions: bool) -> dict[str, Any]:
    """One line of a frame stream: `type` is header, frame or event."""
    if isinstance(item, FrameRecord):
        return _frame_json(item, session, positions)
    if isinstance(item, StreamStart):
        return {
            "type": "header",
            "session": session.name,
            "skeleton_id": session.skeleton.id,
            "frame_rate": FRAME_RATE,
            "first_sequence": item.first_sequence,
            "discontinuity": item.discontinuity,
            "last_control_id": session.last_control_id,
        }
    return _event_json(item)


def _frame_json(record: FrameRecord, session: Session, positions: bool) -> dict[str, Any]:
    data = record.data
    floor = np.array([0, session.floor_height, 0], np.float32)
    body: dict[str, Any] = {
        "type": "frame",
        "sequence": record.sequence,
        "time": record.sequence / FRAME_RATE,
        "action": data.action,
        "goal_distance": data.goal_distance,
        "contacts": [bool(touching) for touching in data.contacts],
        "root_position": (data.root_position + floor).tolist(),
        "rotations": data.rotations.tolist(),
    }
    if positions:
        body["joint_positions"] = (data.positions + floor).tolist()
    return body


def _event_json(event: Event) -> dict[str, Any]:
    kind = motion_pb2.EventType.Name(event.type).removeprefix("EVENT_TYPE_").lower()
    body: dict[str, Any] = {"type": "event", "event": kind, "sequence": event.sequence, "message": event.message}
    for field in ("control_id", "goal_pose", "skipped_count"):
        if value := getattr(event, field):
            body[field] = value
    return body
