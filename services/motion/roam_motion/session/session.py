"""One character: its state, the controls on their way to it, its last frames and the readers that follow it."""

import asyncio
import sys
from collections import OrderedDict, deque
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any, Protocol

import numpy as np
from roam_character.skeleton import Skeleton
from roam_serving.access import CALLER

from roam_motion.animator import CharacterState, FrameData, Goal, Idle, Intent
from roam_motion.session.records import (
    Claim,
    ControlChange,
    ControlEntry,
    ControlRequest,
    Event,
    EventKind,
    SessionRecord,
    Snapshot,
)

_REMEMBERED_CONTROLS = 1024  # answers kept for controls that are sent again
_EARLIER = 32  # ids that one stored control stands for besides its own; of more only the newest are remembered
_STORED_ANSWERS = 64  # of them, those that a snapshot carries
_SETTLED_FRAMES = 10  # a third of a second near the goal and still: reached
_STILL = 0.002  # [m] change of the goal distance per frame, 6 cm/s


@dataclass(frozen=True, eq=False)
class FrameRecord:
    """A frame with its sequence; packed messages are kept beside it so that many readers cost one packing."""

    sequence: int
    data: FrameData
    before: tuple[FrameData, ...] = ()  # the frames just before it, the latest first: two, fewer at the beginning
    packed: dict[Hashable, Any] = field(default_factory=dict)  # by format; the transports' own


@dataclass
class ArrivalDetector:
    """Says once per goal that the character has arrived and settled."""

    tolerance: float  # [m]
    near: int = 0
    last: float | None = None  # distance at the frame before [m]
    told: bool = False

    @property
    def state(self) -> tuple[int, float | None, bool]:
        """All that it remembers."""
        return self.near, self.last, self.told

    def restart(self, near: int = 0, last: float | None = None, told: bool = False) -> None:
        """A new goal was given; or an earlier `state` comes back."""
        self.near, self.last, self.told = near, last, told

    def reached(self, distance: float | None) -> bool:
        """True on the frame at which the goal counts as reached; `distance` to the goal pose [m]."""
        if distance is None or self.told:
            return False
        steady = self.last is not None and abs(distance - self.last) < _STILL
        self.near, self.last = (self.near + 1 if steady and distance < self.tolerance else 0), distance
        self.told = self.near >= _SETTLED_FRAMES
        return self.told


class Reader(Protocol):
    """A connected stream, as its session sees it."""

    id: str
    realtime: bool

    @property
    def cursor(self) -> int:
        """Last sequence that the reader was given."""

    @property
    def wanted(self) -> int:
        """How many frames it asks for that do not exist yet; 0 for a REALTIME reader, who waits for the tick."""

    def wake(self) -> None:
        """Lets it look again."""

    def acknowledge(self, sequence: int, credit: int) -> None:
        """The reader has frames up to `sequence` and can take `credit` more."""

    def put_event(self, event: Event, *, after: int) -> None:
        """Queues an event behind frame `after`."""

    def finish(self) -> None:
        """Ends it once its events are sent."""


class Session:
    """One character. All methods run on the event loop; only the animator's step leaves it."""

    def __init__(
        self,
        record: SessionRecord,
        *,
        skeleton: Skeleton,
        state: CharacterState,
        ring_frames: int,
        goal_tolerance: float,
        clock: Callable[[], float],
    ) -> None:
        self.record = record
        self.skeleton = skeleton
        self.state = state
        self.sequence = 0
        self.touched = clock()
        self.caller = CALLER.get()  # whose budget it counts against: who made it, or brought it here
        self.one_control = asyncio.Lock()  # controls are taken one after the other
        self.paused = False
        self.under_way = 0  # frames that a step is computing right now
        self.held = False  # a control is being written down; no further step starts meanwhile
        self.ended = False
        self.exact = True  # false once it was restored on a machine that computes differently
        self.replay_until = 0  # frames up to here were seen before a takeover, and are computed again at once
        self.ring: deque[FrameRecord] = deque(maxlen=ring_frames)
        self.streams: set[Reader] = set()
        self.last_control_id = 0
        self.reached: Event | None = None  # the last GOAL_REACHED
        self.limit = sys.maxsize  # no frame after this one is computed before a newer snapshot is safe
        self._seen_elsewhere = 0  # a replica before this one may have shown frames up to here
        self._change = ControlChange()  # the one whose intent is in force
        self._owed = False  # a tick came while the session was held
        self._answers: OrderedDict[int, int] = OrderedDict()
        self._schedule: deque[ControlEntry] = deque()
        self._last: ControlEntry | None = None  # the newest control taken
        self._kept: deque[tuple[int, int]] = deque()  # effective sequences and sizes of controls that the store keeps
        self._arrival = ArrivalDetector(goal_tolerance)
        self._clock = clock

    @property
    def name(self) -> str:
        """Resource name."""
        return self.record.name

    @property
    def intent(self) -> Intent:
        """What the next frame is asked for unless a control says otherwise."""
        return self._change.intent or Idle()

    @property
    def newest_intent(self) -> Intent:
        """What the controls taken so far come to, those that wait for their frame included."""
        waiting = [entry.change.intent for entry in self._schedule if entry.change.intent is not None]
        return waiting[-1] if waiting else self.intent

    @property
    def floor_height(self) -> float:
        """Height of the floor [m]; the animator walks at 0."""
        return self.record.floor_height

    @property
    def place(self) -> tuple[float, float]:
        """Where the character is on the floor: x, z [m]."""
        return self.state.place

    @property
    def expire_time(self) -> float:
        """When it is reclaimed if nobody connects until then [s since 1970]."""
        start = self._clock() if self.streams else self.touched
        return start + self.record.idle_timeout

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

    # Controls

    def answer(self, control_id: int) -> int | None:
        """The effective sequence that was answered to a control seen before; None for a new one."""
        if not 0 < control_id <= self.last_control_id:
            return None
        known = self._answers.get(control_id)
        return known if known is not None else min(self._answers.values(), default=self.sequence)

    @contextmanager
    def hold(self) -> Iterator[None]:
        """No further step starts, so that the first frame that a control can affect stays the first."""
        self.held = True
        try:
            yield
        finally:
            self.held = False

    def entry(self, control: ControlRequest) -> ControlEntry:
        """Names the first frame that a control (above the animator's floor) can affect; its id 0 takes the next one."""
        # a step that runs right now was given the old intent
        effective = max(self.sequence + self.under_way, self._seen_elsewhere) + 1
        control_id = control.control_id or self.last_control_id + 1
        change, last = control.change, self._last
        if last is None or last.effective != effective:
            return ControlEntry(control_id, effective, change)
        earlier = (*last.earlier, last.control_id)[-_EARLIER:]
        return ControlEntry(control_id, effective, last.change.followed_by(change), earlier)

    def kept_bytes(self, history: int) -> int:
        """About how much of its controls the store keeps, which is those of the last `history` frames [bytes]."""
        while self._kept and self._kept[0][0] <= self.sequence - history:
            self._kept.popleft()
        return sum(size for _, size in self._kept)

    def accept(self, entry: ControlEntry) -> None:
        """Puts a control in force from its frame on and tells the streams."""
        if entry.change.paused is not None:
            self.paused = entry.change.paused
        if self._last is not None and self._last.effective == entry.effective:  # it stands for that one too
            self._kept.pop()
            if self._schedule and self._schedule[-1].effective == entry.effective:
                self._schedule.pop()
        self._last = entry
        self._kept.append((entry.effective, entry.change.size))
        if entry.change.intent is not None:
            self._schedule.append(entry)
        self.last_control_id = entry.control_id
        for control_id in (*entry.earlier, entry.control_id):
            self._answers[control_id] = entry.effective
        while len(self._answers) > _REMEMBERED_CONTROLS:
            self._answers.popitem(last=False)
        self.announce(self._applied(entry.control_id, entry.effective), after=0)

    def applied_after(self, sequence: int) -> list[Event]:
        """What readers were told, or should have been, of controls that take effect after a frame."""
        return [self._applied(*answer) for answer in self._answers.items() if answer[1] > sequence]

    def _applied(self, control_id: int, effective: int) -> Event:
        return Event(EventKind.CONTROL_APPLIED, effective, control_id=control_id)

    def intents(self, count: int) -> list[Intent]:
        """The intents of the next `count` frames."""
        intents, intent, waiting = [], self.intent, deque(self._schedule)
        for sequence in range(self.sequence + 1, self.sequence + count + 1):
            while waiting and waiting[0].effective <= sequence:
                intent = waiting.popleft().change.intent or intent
            intents.append(intent)
        return intents

    # Between replicas

    def snapshot(self, build: str) -> Snapshot:
        """All that another replica needs to go on from here; `build` names what computes the frames."""
        answers = list(self._answers.items())[-_STORED_ANSWERS:]
        state, volume = self.state.split()
        return Snapshot(
            sequence=self.sequence,
            state=state,
            volume=volume,
            change=self._change,
            paused=self.paused,
            last_control_id=self.last_control_id,
            answers=tuple(answers),
            arrival=self._arrival.state,
            reached=self.reached,
            build=build if self.exact else "",
            shown=self._seen_elsewhere,
        )

    def restore(self, snapshot: Snapshot, claim: Claim, *, shown: int) -> None:
        """Goes back to a snapshot, whose `state` this session was made with, and to the controls taken after it.

        Frames up to the newest snapshot and the newest control of the `claim` are computed again at once. Replicas
        before may have shown frames up to `shown`: new controls come after those.
        """
        self.sequence = snapshot.sequence
        self.paused = snapshot.paused
        self.last_control_id = snapshot.last_control_id
        self._answers = OrderedDict(snapshot.answers)
        self.reached = snapshot.reached
        self._change = snapshot.change
        self._arrival.restart(*snapshot.arrival)
        for entry in claim.controls:
            if entry.effective > snapshot.sequence:
                self.accept(entry)
        newest = claim.snapshots[-1].sequence
        self.replay_until = max([newest, *(entry.effective - 1 for entry in claim.controls)])
        self._seen_elsewhere = max(shown, self.replay_until)

    def lacks(self, after_sequence: int) -> bool:
        """Whether frames after this one were computed elsewhere and could be computed again, disturbing nobody."""
        return bool(self._seen_elsewhere and not self.streams and 0 < after_sequence < self.first_kept - 1)

    def catch_up(self, sequence: int) -> None:
        """Computes again, at once, up to a frame that a reader had from the replica before."""
        if sequence <= self._seen_elsewhere:
            self.replay_until = max(self.replay_until, sequence)

    # Frames

    def wants(self, *, tick: bool) -> int:
        """How many frames are due: one on the tick for REALTIME readers, else what readers ask for."""
        safe = self.limit - self.sequence
        if self.ended or self.under_way or safe <= 0:
            return 0
        if self.sequence < self.replay_until:  # no control that is being written down can affect these
            return min(safe, self.replay_until - self.sequence)
        if self.paused or not self.streams:
            return 0
        if any(stream.realtime for stream in self.streams):
            return self._due(tick)
        if self.held:
            return 0
        # no reader may lose a frame that it has not taken yet
        room = min(stream.cursor for stream in self.streams) + self.ring_size - 1 - self.sequence
        return max(0, min(safe, room, max(stream.wanted for stream in self.streams)))

    def _due(self, tick: bool) -> int:
        self._owed = self._owed or tick
        if not self._owed or self.held:
            return 0
        self._owed = False
        return 1

    def advance(self, state: CharacterState, data: FrameData) -> None:
        """Takes the next frame from the animator and tells the streams."""
        if not (np.isfinite(data.root_position).all() and np.isfinite(data.rotations).all()):
            raise FloatingPointError(f"frame {self.sequence + 1} of {self.name} is not finite")
        self.state = state
        self.sequence += 1
        while self._schedule and self._schedule[0].effective <= self.sequence:
            self._enter(self._schedule.popleft().change)
        before = tuple(record.data for record in islice(reversed(self.ring), 2))
        self.ring.append(FrameRecord(self.sequence, data, before))
        if isinstance(self.intent, Goal) and self._arrival.reached(data.goal_distance):
            self._tell_reached(data.goal_distance)
        for stream in self.streams:
            stream.wake()

    def _enter(self, change: ControlChange) -> None:
        """A control's frame has come."""
        if change.intent is not None:
            self._change = change
            self._arrival.restart()

    def _tell_reached(self, distance: float | None) -> None:
        self.reached = Event(
            EventKind.GOAL_REACHED,
            self.sequence,
            goal_pose=self._change.goal_name,
            message=f"{distance:.3f} m from the goal pose and still",
        )
        self.announce(self.reached, after=self.sequence)

    def announce(self, event: Event, *, after: int) -> None:
        """Puts an event into every stream, to be sent once the reader has frame `after`."""
        for stream in self.streams:
            stream.put_event(event, after=after)

    def end(self, event: Event) -> None:
        """Ends all streams with an event; the session is not stepped here any more."""
        self.ended = True
        self.announce(replace(event, sequence=self.sequence), after=0)
        for stream in self.streams:
            stream.finish()

    @property
    def ring_size(self) -> int:
        """How many frames the ring can hold."""
        assert self.ring.maxlen is not None
        return self.ring.maxlen
