"""A session's own types: what it is asked for, what it tells its readers, and what outlives the replica that runs it.

None of them knows how it travels: `api/` maps them to protobuf and JSON, `store/` writes them down.
"""

from dataclasses import dataclass, replace
from enum import Enum

from roam_character.volume import Volume

from roam_motion.control.intent import Goal, Intent, raised


class EventKind(Enum):
    """What a session tells its readers besides frames; the value is the event's name in JSON."""

    GOAL_REACHED = "goal_reached"
    FRAMES_SKIPPED = "frames_skipped"
    DRAINING = "draining"
    CONTROL_APPLIED = "control_applied"
    SESSION_ENDED = "session_ended"
    WARNING = "warning"


_SMALL, _SMALL_GOAL = 64, 1024  # [bytes] of a control without and with a pose
_CORNER = 16  # [bytes] of an outline


@dataclass(frozen=True)
class Event:
    """Something that happened to a session at a frame."""

    kind: EventKind
    sequence: int = 0  # the frame
    message: str = ""
    reason: str = ""  # WARNING: which, UPPER_SNAKE_CASE
    control_id: int = 0  # CONTROL_APPLIED: which
    goal_pose: str = ""  # GOAL_REACHED: the name that the client gave it
    skipped_count: int = 0  # FRAMES_SKIPPED: how many
    reconnect_within: int | None = None  # DRAINING: [s]


@dataclass(frozen=True)
class SessionRequest:
    """What a new session is asked to be. Metres, radians, seconds."""

    request_id: str = ""  # the same one again returns the same session
    position: tuple[float, float] = (0.0, 0.0)  # x, z
    yaw: float = 0.0  # heading about +Y; 0 faces +Z
    seed: int = 0
    idle_timeout: float | None = None  # None: the server's default
    floor_height: float = 0.0
    skeleton_id: str = ""  # "": the server's default


@dataclass(frozen=True)
class ControlChange:
    """What a control changes: the intent, or whether time runs."""

    intent: Intent | None = None
    goal_name: str = ""  # the client's name for a goal, repeated in events
    paused: bool | None = None

    def lowered(self, floor_height: float) -> "ControlChange":
        """From the client's world to the animator's, whose floor is at 0."""
        return self if self.intent is None else replace(self, intent=raised(self.intent, -floor_height))

    def followed_by(self, newer: "ControlChange") -> "ControlChange":
        """Both at the same frame: of each kind the newer counts."""
        intent, goal_name = (self.intent, self.goal_name) if newer.intent is None else (newer.intent, newer.goal_name)
        return ControlChange(intent, goal_name, self.paused if newer.paused is None else newer.paused)

    @property
    def size(self) -> int:
        """About how many bytes it takes to keep."""
        if self.intent is None:
            return _SMALL
        if not isinstance(self.intent, Goal):
            return _SMALL + _CORNER * sum(map(len, self.intent.around))
        corners = sum(map(len, self.intent.obstacles))
        return _SMALL_GOAL + _CORNER * corners + (len(self.intent.volume.packed) if self.intent.volume else 0)


@dataclass(frozen=True)
class ControlRequest:
    """A control as the client sent it, checked; heights are above the client's origin."""

    control_id: int  # 0 takes the next free one
    change: ControlChange


@dataclass(frozen=True)
class SessionRecord:
    """The terms of a session; they never change."""

    name: str  # "sessions/{id}"
    resume_token: str
    request_id: str
    skeleton_id: str
    create_time: float  # [s since 1970]
    idle_timeout: float  # [s]
    floor_height: float  # [m]
    owner: str = ""  # name of the API key that made it: for others it is not there. "": everybody's


@dataclass(frozen=True)
class ControlEntry:
    """A control that was taken."""

    control_id: int
    effective: int  # first frame it can affect
    change: ControlChange
    earlier: tuple[int, ...] = ()  # ids of controls of the same frame that it stands for too


@dataclass(frozen=True)
class Snapshot:
    """A session between two frames.

    A frame depends on nothing but the seed and the controls before it. So whoever has a snapshot and the controls after
    it computes the same frames again, and goes on where the replica that died had stopped.
    """

    sequence: int
    state: bytes  # of the character, see `CharacterState.split`
    volume: Volume | None  # the furniture that belongs to it
    change: ControlChange  # the control whose intent is in force; an empty one: none yet
    paused: bool
    last_control_id: int
    answers: tuple[tuple[int, int], ...]  # control_id, effective sequence
    arrival: tuple[int, float | None, bool]  # see `ArrivalDetector.state`
    reached: Event | None  # the last GOAL_REACHED
    build: str  # what computed the frames; where this differs they may differ in the last bits. "": mixed
    shown: int = 0  # a replica that died may have shown frames up to here

    @property
    def volumes(self) -> tuple[Volume, ...]:
        """The furniture that it speaks of; stores keep each once."""
        return (*volumes_of(self.change), *([self.volume] if self.volume else []))


def volumes_of(change: ControlChange) -> tuple[Volume, ...]:
    """The furniture that a control speaks of."""
    intent = change.intent
    return (intent.volume,) if isinstance(intent, Goal) and intent.volume is not None else ()


@dataclass(frozen=True)
class Claim:
    """A session taken over: everything there is to know of it, and the token that fences all others off from here."""

    record: SessionRecord
    token: int
    snapshots: tuple[Snapshot, ...]  # oldest first, at least one
    controls: tuple[ControlEntry, ...]  # in order
    released: bool  # the owner gave it up after the last snapshot; else it may have gone on from there

    def snapshot_before(self, sequence: int) -> Snapshot:
        """The newest snapshot from which frame `sequence` + 1 can be computed; 0: the newest of all."""
        if not sequence:
            return self.snapshots[-1]
        earlier = [snapshot for snapshot in self.snapshots if snapshot.sequence <= sequence]
        return earlier[-1] if earlier else self.snapshots[0]
