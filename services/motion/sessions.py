"""Sessions: one character each, with its control cursor, its last frames and its connected streams."""

from collections import OrderedDict, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from time import time
from typing import TYPE_CHECKING
from uuid import uuid4

import numpy as np
from character.skeleton import Skeleton
from roam.v1 import motion_pb2
from serving.errors import ServiceError

from motion.errors import SESSION_NOT_FOUND, SESSION_QUOTA
from motion.step import CharacterState, FrameData, Goal, Idle, Intent

if TYPE_CHECKING:
    from motion.stream import FrameStream

_REMEMBERED_CONTROLS = 1024  # answers kept for controls that are sent again
_SETTLED_FRAMES = 10  # this long near the goal and still: reached
_STILL = 0.002  # change of goal distance per frame [m]

Event = motion_pb2.SessionEvent


@dataclass(frozen=True, eq=False)
class FrameRecord:
    """A frame with its sequence; packed messages are kept beside it so that many readers cost one packing."""

    sequence: int
    data: FrameData
    packed: dict[tuple[int, bool], motion_pb2.Frame] = field(default_factory=dict)


@dataclass
class GoalWatch:
    """Says once per goal that the character has arrived and settled."""

    tolerance: float  # [m]
    near: int = 0
    last: float = float("inf")
    told: bool = False

    def restart(self) -> None:
        """A new goal was given."""
        self.near, self.last, self.told = 0, float("inf"), False

    def reached(self, distance: float | None) -> bool:
        """True on the frame at which the goal counts as reached."""
        if distance is None or self.told:
            return False
        still = distance < self.tolerance and abs(distance - self.last) < _STILL
        self.near, self.last = (self.near + 1 if still else 0), distance
        self.told = self.near >= _SETTLED_FRAMES
        return self.told


class Session:
    """One character. All methods run on the event loop; only the animator's step leaves it."""

    def __init__(
        self,
        *,
        skeleton: Skeleton,
        state: CharacterState,
        floor_height: float,
        idle_timeout: float,
        ring_frames: int,
        goal_tolerance: float,
        clock: Callable[[], float],
    ) -> None:
        self.name = f"sessions/{uuid4().hex}"
        self.resume_token = uuid4().hex
        self.skeleton = skeleton
        self.state = state
        self.intent: Intent = Idle()
        self.goal_name = ""
        self.floor_height = floor_height  # [m]; the animator walks at 0
        self.idle_timeout = idle_timeout  # [s]
        self.create_time = self.touched = clock()
        self.paused = False
        self.stepping = False
        self.ended = False
        self.sequence = 0
        self.ring: deque[FrameRecord] = deque(maxlen=ring_frames)
        self.last_control_id = 0
        self.streams: set[FrameStream] = set()
        self._controls: OrderedDict[int, int] = OrderedDict()
        self._watch = GoalWatch(goal_tolerance)
        self._clock = clock

    @property
    def expire_time(self) -> float:
        """When it is reclaimed if nobody connects until then [s since 1970]."""
        start = self._clock() if self.streams else self.touched
        return start + self.idle_timeout

    @property
    def first_kept(self) -> int:
        """Sequence of the oldest frame in the ring; the next one to come while the ring is empty."""
        return self.ring[0].sequence if self.ring else self.sequence + 1

    def touch(self) -> None:
        """A client was here: the idle timeout starts again."""
        self.touched = self._clock()

    def frame(self, sequence: int) -> FrameRecord | None:
        """A kept frame."""
        index = sequence - self.first_kept
        return self.ring[index] if 0 <= index < len(self.ring) else None

    def control(self, control_id: int, change: "ControlChange") -> int:
        """Applies a control; returns the first sequence it can affect. A control_id seen before changes nothing.

        0 as control_id takes the next free one.
        """
        control_id = control_id or self.last_control_id + 1
        if control_id <= self.last_control_id:
            known = self._controls.get(control_id)
            return known if known is not None else min(self._controls.values(), default=self.sequence)
        # a step that runs right now was given the old intent
        effective = self.sequence + (2 if self.stepping else 1)
        if change.paused is not None:
            self.paused = change.paused
        if change.intent is not None:
            self.intent = change.intent
            self.goal_name = change.goal_name
            self._watch.restart()
        self.last_control_id = control_id
        self._controls[control_id] = effective
        if len(self._controls) > _REMEMBERED_CONTROLS:
            self._controls.popitem(last=False)
        self.announce(
            Event(type=motion_pb2.EVENT_TYPE_CONTROL_APPLIED, sequence=effective, control_id=control_id), after=0
        )
        return effective

    def advance(self, state: CharacterState, data: FrameData) -> None:
        """Takes the next frame from the animator and tells the streams."""
        if not (np.isfinite(data.root_position).all() and np.isfinite(data.rotations).all()):
            raise FloatingPointError(f"frame {self.sequence + 1} of {self.name} is not finite")
        self.state = state
        self.sequence += 1
        self.ring.append(FrameRecord(self.sequence, data))
        if isinstance(self.intent, Goal) and self._watch.reached(data.goal_distance):
            self.announce(
                Event(
                    type=motion_pb2.EVENT_TYPE_GOAL_REACHED,
                    sequence=self.sequence,
                    goal_pose=self.goal_name,
                    message=f"{data.goal_distance:.3f} m from the goal pose and still",
                ),
                after=self.sequence,
            )
        for stream in self.streams:
            stream.wake()

    def announce(self, event: Event, *, after: int) -> None:
        """Puts an event into every stream, to be sent once the reader has frame `after`."""
        for stream in self.streams:
            stream.put_event(event, after=after)

    def end(self, message: str) -> None:
        """Ends all streams; the session is not stepped any more."""
        self.ended = True
        self.announce(Event(type=motion_pb2.EVENT_TYPE_SESSION_ENDED, sequence=self.sequence, message=message), after=0)
        for stream in self.streams:
            stream.finish()

    def wants_step(self, *, tick: bool) -> bool:
        """Whether the next frame is due: on the tick for REALTIME readers, else when a reader asks for it."""
        if self.ended or self.paused or self.stepping or not self.streams:
            return False
        if any(stream.realtime for stream in self.streams):
            return tick
        # no reader may lose a frame that it has not taken yet
        room = all(self.sequence - stream.cursor < self.ring_size - 1 for stream in self.streams)
        return room and any(stream.hungry for stream in self.streams)

    @property
    def ring_size(self) -> int:
        """How many frames the ring can hold."""
        assert self.ring.maxlen is not None
        return self.ring.maxlen


@dataclass(frozen=True)
class ControlChange:
    """What a control changes: the intent, or whether time runs."""

    intent: Intent | None = None
    goal_name: str = ""
    paused: bool | None = None


class SessionStore:
    """The sessions of this process; in memory."""

    def __init__(self, limit: int, clock: Callable[[], float] = time) -> None:
        self._limit = limit
        self._clock = clock
        self._sessions: dict[str, Session] = {}
        self._by_request: dict[str, str] = {}  # request_id → session name

    def __len__(self) -> int:
        return len(self._sessions)

    def __iter__(self) -> Iterator[Session]:
        return iter(list(self._sessions.values()))

    def of_request(self, request_id: str) -> Session | None:
        """The session that an earlier request with this id made."""
        name = self._by_request.get(request_id) if request_id else None
        return self._sessions.get(name) if name else None

    def check_quota(self) -> None:
        """Raises SESSION_QUOTA when no further session fits; expired ones are dropped first."""
        self.drop_expired()
        if len(self._sessions) >= self._limit:
            soonest = min(session.expire_time for session in self._sessions.values())
            wait = max(1.0, soonest - self._clock())
            raise ServiceError(SESSION_QUOTA, f"{self._limit} sessions are alive", retry_after=round(wait, 1))

    def add(self, session: Session, request_id: str) -> None:
        """Keeps a new session."""
        self._sessions[session.name] = session
        if request_id:
            self._by_request[request_id] = session.name

    def get(self, name: str) -> Session:
        """A live session; SESSION_NOT_FOUND otherwise."""
        session = self._sessions.get(name)
        if session is None:
            raise ServiceError(SESSION_NOT_FOUND, f"no session {name!r}", field="session")
        return session

    def remove(self, name: str, message: str) -> None:
        """Ends a session and forgets it at once."""
        session = self.get(name)
        del self._sessions[name]
        self._by_request = {key: value for key, value in self._by_request.items() if value != name}
        session.end(message)

    def drop_expired(self) -> None:
        """Reclaims sessions whose idle timeout has passed without a client."""
        now = self._clock()
        for session in self:
            if not session.streams and session.expire_time <= now:
                self.remove(session.name, "expired")
