"""JSON of the motion service: what HTTP takes and gives. Arrays are nested lists; metres, radians, xyzw."""

from typing import Annotated, Any

import numpy as np
from pydantic import Base64Bytes, BaseModel, ConfigDict, Field
from roam_character.pose import Pose
from roam_character.skeleton import Skeleton
from roam_character.volume import Volume
from roam_serving.errors import INVALID_ARGUMENT, ServiceError

from roam_motion.actions import ACTIONS, SIT
from roam_motion.animation.state import FRAME_RATE
from roam_motion.api import validation
from roam_motion.control.actions import GOAL_ACTIONS
from roam_motion.control.intent import Goal, Idle, Steer
from roam_motion.session.records import ControlChange, ControlRequest, Event, SessionRequest
from roam_motion.session.session import FrameRecord, Session
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

    def pose(self, skeleton: Skeleton, *, field: str) -> Pose:
        """As the service's own type; GOAL_INVALID or SKELETON_NOT_FOUND when it does not fit `skeleton`."""
        position, rotations = np.array(self.root_position, np.float32), np.array(self.rotations, np.float32)
        return validation.pose(skeleton, self.skeleton_id, position, rotations.reshape(-1, 4), field=field)


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

    def request(self) -> SessionRequest:
        """As the service's own type; INVALID_ARGUMENT names what is too far away."""
        x, z, yaw = (
            validation.finite(float(np.float32(getattr(self.start, name))), f"start_placement.{name}")
            for name in ("x", "z", "yaw")
        )
        return SessionRequest(
            request_id=self.request_id,
            position=(x, z),
            yaw=yaw,
            seed=self.seed or 0,
            idle_timeout=self.idle_timeout,
            floor_height=validation.finite(float(np.float32(self.floor_height)), "floor_height"),
            skeleton_id=self.skeleton_id,
        )


class SteerJson(_Strict):
    """Steer by hand."""

    velocity: Annotated[list[Number], Field(min_length=2, max_length=2)] = Field(description="world x, z [m/s]")
    facing: Number | None = Field(None, description="heading [rad]; absent: face where it walks")
    look_at: Vector | None = Field(None, description="a place to look at, world x y z [m]")

    def intent(self) -> Steer | Idle:
        """As the service's own type."""
        x, z = self.velocity
        return validation.steer((x, z), self.facing, _point(self.look_at, "control.steer.look_at"))


class VolumeJson(_Strict):
    """The furniture of a goal: the `volume` of a goal pose can be sent as it is."""

    origin: Vector = Field(description="node (0, 0, 0), world x y z [m]")
    pitch: Number = Field(description="distance between nodes [m]")
    yaw: Number = Field(0.0, description="heading of the grid's z axis about +Y [rad]")
    size: Annotated[list[Annotated[int, Field(ge=2, le=100_000)]], Field(min_length=3, max_length=3)]
    values: Base64Bytes = Field(description="int8 [x, y, z]: signed distance in steps of 2.5 mm, negative inside")

    def volume(self) -> Volume:
        """As the service's own type; GOAL_INVALID when sizes and values do not fit."""
        return validation.volume(self.origin, self.pitch, self.yaw, self.size, self.values)


def _known_actions(schema: dict[str, Any]) -> None:
    """Tells the actions that there are when the description is asked for."""
    schema["enum"] = list(GOAL_ACTIONS)


class GoalJson(_Strict):
    """Head for a goal pose."""

    pose: PoseJson
    action: str = Field(SIT.name, description="what to do there", json_schema_extra=_known_actions)
    goal_pose: str = Field("", max_length=256, description="its name, repeated in events")
    approach: Number | None = Field(None, description="lying: heading from the hips to the open side [rad]")
    obstacles: list[list[tuple[Number, Number]]] = Field(
        [],
        description="what to walk round, the goal's furniture included: corners x, z [m] of outlines",
    )
    volume: VolumeJson | None = Field(None, description="the furniture itself, which arms and legs keep out of")
    look_at: Vector | None = Field(None, description="a place to look at, world x y z [m]")

    def intent(self, skeleton: Skeleton) -> Goal:
        """As the service's own type; GOAL_INVALID names the field that is wrong."""
        approach = None if self.approach is None else validation.direction(self.approach, "control.goal.approach")
        return Goal(
            action=validation.goal_action(ACTIONS.get(self.action)).name,
            pose=self.pose.pose(skeleton, field="control.goal.pose"),
            approach=approach,
            obstacles=validation.obstacles([sum(corners, ()) for corners in self.obstacles]),
            volume=None if self.volume is None else self.volume.volume(),
            look_at=_point(self.look_at, "control.goal.look_at"),
        )


def _point(place: list[float] | None, field: str) -> np.ndarray | None:
    return None if place is None else validation.point(place, field)


class PlaybackJson(_Strict):
    """Hold or go on."""

    paused: bool


class ControlJson(_Strict):
    """Body of POST /v1/sessions/{id}/control: one of steer, goal and playback."""

    control_id: int = Field(0, ge=0, lt=1 << 63, description="client-chosen 1, 2, 3, …; 0 takes the next free one")
    steer: SteerJson | None = None
    goal: GoalJson | None = None
    playback: PlaybackJson | None = None

    def request(self, skeleton: Skeleton) -> ControlRequest:
        """As the service's own type; the last one given wins, as in a protobuf oneof."""
        if self.playback is not None:
            change = ControlChange(paused=self.playback.paused)
        elif self.goal is not None:
            change = ControlChange(self.goal.intent(skeleton), self.goal.goal_pose)
        elif self.steer is not None:
            change = ControlChange(self.steer.intent())
        else:
            detail = "a control needs one of steer, goal or playback"
            raise ServiceError(INVALID_ARGUMENT, detail, field="control.input")
        return ControlRequest(self.control_id, change)


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
    body: dict[str, Any] = {
        "type": "event",
        "event": event.kind.value,
        "sequence": event.sequence,
        "message": event.message,
    }
    for field in ("reason", "control_id", "goal_pose", "skipped_count"):
        if value := getattr(event, field):
            body[field] = value
    return body
