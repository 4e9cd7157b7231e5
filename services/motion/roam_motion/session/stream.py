"""What one connected reader gets, and when: pacing, credit, skipping, events, the end; and what is counted of it.

A stream keeps no frames of its own, only a cursor into the session's ring: a reader that stalls costs nothing.
"""

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from time import monotonic
from uuid import uuid4

from prometheus_client import CollectorRegistry, Counter, Histogram
from roam_serving.errors import INVALID_ARGUMENT, ServiceError

from roam_motion.errors import SEQUENCE_AHEAD
from roam_motion.session.records import Event, EventKind
from roam_motion.session.session import FrameRecord, Session

_FIRST = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5)
_INTERVALS = (0.01, 0.02, 0.03, 0.0325, 0.034, 0.036, 0.04, 0.05, 0.07, 0.1, 0.2, 0.5, 1)  # fine around 1/30 s


class Pacing(Enum):
    """Who sets the pace; the value is its name in JSON."""

    REALTIME = "realtime"  # the clock: the newest frame, thirty times a second
    CREDIT = "credit"  # the reader: as many frames as it has asked for
    BURST = "burst"  # the server: every frame, as fast as they can be computed


@dataclass(frozen=True)
class StreamOptions:
    """What a reader asks of a stream, and what the server allows it."""

    pacing: Pacing = Pacing.REALTIME
    after_sequence: int = 0  # the last frame that the reader has
    resume_token: str = ""  # proves that it read this session before
    credit: int = 0  # frames that a CREDIT reader can take
    burst_frames: int = 60  # how far a BURST stream is computed ahead of its reader
    ack_window: int = 12  # unacknowledged frames that a REALTIME reader which acknowledges may have


@dataclass(frozen=True)
class StreamStart:
    """What the header tells about the first frame."""

    first_sequence: int
    discontinuity: bool


Item = StreamStart | FrameRecord | Event


class FrameStream:
    """An asynchronous iterator of StreamStart, then frames and events, until the session ends or the reader goes."""

    def __init__(
        self,
        session: Session,
        options: StreamOptions,
        demand: Callable[[], None],
        told: Callable[[Item], None] = lambda item: None,
    ) -> None:
        _check(session, options)
        self.id = uuid4().hex[:12]
        self.session = session
        self.options = options
        self.realtime = options.pacing == Pacing.REALTIME
        self.credit = options.credit
        self.acknowledges = False  # from the first Ack on, a REALTIME reader has a window
        self._unacknowledged: deque[int] = deque(maxlen=options.ack_window)
        self.cursor, discontinuity = _starting_point(session, options, self.realtime)
        self._start: StreamStart | None = StreamStart(self.cursor + 1, discontinuity)
        self._backlog_end = max(session.sequence, session.replay_until) if options.after_sequence else 0
        self._events: deque[tuple[int, Event]] = deque()
        self._finished = False
        self._awake = asyncio.Event()
        self._told = told  # sees every item that the reader gets
        self._demand = demand  # tells the ticker that this reader may want a frame
        reached = session.reached
        if options.after_sequence and reached is not None and reached.sequence >= options.after_sequence:
            self.put_event(reached, after=reached.sequence)  # the break may have swallowed it

    @property
    def wanted(self) -> int:
        """How many frames a reader that sets the pace asks for that do not exist yet."""
        if self.realtime:
            return 0
        credit = self.options.pacing == Pacing.CREDIT
        allowed = self.credit if credit else self.options.burst_frames
        return max(0, self.cursor + allowed - self.session.sequence)

    def acknowledge(self, sequence: int, credit: int) -> None:
        """The reader has frames up to `sequence` and can take `credit` more."""
        self.acknowledges = True
        while self._unacknowledged and self._unacknowledged[0] <= sequence:
            self._unacknowledged.popleft()
        self.credit += credit
        self.wake()
        self._demand()

    def put_event(self, event: Event, *, after: int) -> None:
        """Queues an event behind frame `after`; none for what the reader had before it came back."""
        if after and after < self.options.after_sequence:
            return
        self._events.append((after, event))
        self.wake()

    def finish(self) -> None:
        """Ends the stream once its events are sent."""
        self._finished = True
        self.wake()

    def wake(self) -> None:
        """Lets the reader look again."""
        self._awake.set()

    def __aiter__(self) -> "FrameStream":
        return self

    async def __anext__(self) -> Item:
        while True:
            item = self.next()
            if item is not None:
                return item
            if self._finished:
                raise StopAsyncIteration
            self._awake.clear()
            await self._awake.wait()

    def next(self) -> Item | None:
        """What the reader can have right now, if anything."""
        item = self._take()
        if item is not None:
            self._told(item)
        if not self.realtime:
            self._demand()
        return item

    def _take(self) -> Item | None:
        if self._start is not None:
            start, self._start = self._start, None
            return start
        for index, (after, event) in enumerate(self._events):
            if after <= self.cursor or self._finished:
                del self._events[index]
                return event
        if self._finished:
            return None
        return self._next_frame()

    def _next_frame(self) -> Item | None:
        head = self.session.sequence
        if self.cursor >= head or not self._may_send():
            return None
        sequence = self.cursor + 1
        if self.realtime and self.cursor >= self._backlog_end:
            sequence = head  # latest wins
        sequence = max(sequence, self.session.first_kept)
        skipped = sequence - self.cursor - 1
        if skipped:
            self.cursor = sequence - 1
            return Event(EventKind.FRAMES_SKIPPED, sequence, skipped_count=skipped)
        frame = self.session.frame(sequence)
        assert frame is not None
        self.cursor = sequence
        self._unacknowledged.append(sequence)
        if self.options.pacing == Pacing.CREDIT:
            self.credit -= 1
        return frame

    def _may_send(self) -> bool:
        if self.options.pacing == Pacing.CREDIT:
            return self.credit > 0
        return not (self.realtime and self.acknowledges and len(self._unacknowledged) == self.options.ack_window)


def _check(session: Session, options: StreamOptions) -> None:
    newest = max(session.sequence, session.replay_until)
    if options.after_sequence > newest:
        detail = f"after_sequence {options.after_sequence} but the newest frame is {newest}"
        raise ServiceError(SEQUENCE_AHEAD, detail, field="open.after_sequence")
    if options.resume_token and options.resume_token != session.record.resume_token:
        raise ServiceError(INVALID_ARGUMENT, "resume_token is of another session", field="open.resume_token")


def _starting_point(session: Session, options: StreamOptions, realtime: bool) -> tuple[int, bool]:
    """The cursor, and whether frames that the reader has not seen are lost."""
    if realtime and not options.after_sequence:
        return max(session.sequence, session.replay_until), False
    oldest = session.first_kept - 1
    return max(options.after_sequence, oldest), oldest > options.after_sequence


class StreamMetrics:
    """Counted where a stream hands an item to its transport."""

    def __init__(self, registry: CollectorRegistry) -> None:
        self._first = Histogram(
            "roam_motion_first_frame_seconds",
            "From opening a stream to its first frame.",
            buckets=_FIRST,
            registry=registry,
        )
        self._intervals = Histogram(
            "roam_motion_frame_interval_seconds",
            "Between two frames of a REALTIME stream.",
            buckets=_INTERVALS,
            registry=registry,
        )
        self._skipped = Counter(
            "roam_motion_frames_skipped", "Frames that readers were too slow for.", registry=registry
        )
        self._resumes = Counter(
            "roam_motion_resumes",
            "Streams that went on after a break: from the ring of the same replica, or from the store.",
            ("path",),
            registry=registry,
        )

    def resumed(self, *, here: bool) -> None:
        """A reader came back; `here` where its session was all the time."""
        self._resumes.labels("ring" if here else "store").inc()

    def reader(self, *, realtime: bool) -> Callable[[Item], None]:
        """What counts the items of one stream, from now on."""
        before, first = monotonic(), True

        def count(item: Item) -> None:
            nonlocal before, first
            if isinstance(item, FrameRecord):
                now = monotonic()
                if first:
                    self._first.observe(now - before)
                elif realtime:
                    self._intervals.observe(now - before)
                before, first = now, False
            elif isinstance(item, Event) and item.kind is EventKind.FRAMES_SKIPPED:
                self._skipped.inc(item.skipped_count)

        return count
