"""Whatever a reader and its session do, in whatever order: no frame twice, none out of order, every gap counted."""

from dataclasses import dataclass, field

from hypothesis import given, settings
from hypothesis import strategies as st
from roam_motion.animator import Idle
from roam_motion.session.records import EventKind, SessionRecord
from roam_motion.session.session import FrameRecord, Session
from roam_motion.session.stream import FrameStream, Pacing, StreamOptions, StreamStart
from walker import Walker

WALKER = Walker()
RING = 6
STATE, FRAME = WALKER._one(WALKER.start((0, 0), 0, 0), Idle())
# How often each kind of thing happens: a frame is computed, the reader looks, acknowledges, breaks off and comes back.
DOINGS = st.lists(st.sampled_from(["step", "step", "step", "read", "acknowledge", "reconnect"]), max_size=60)


@dataclass
class Reader:
    """A client as the protocol describes it, over one session."""

    session: Session
    pacing: Pacing
    taken: list[int] = field(default_factory=list)
    position: int = 0  # the last sequence that was received, or told to be skipped or lost

    def __post_init__(self):
        self.connect()

    def connect(self):
        after = self.taken[-1] if self.taken else 0
        token = self.session.record.resume_token
        options = StreamOptions(pacing=self.pacing, after_sequence=after, credit=2, ack_window=4, resume_token=token)
        self.stream = FrameStream(self.session, options, demand=lambda: None)
        self.session.streams = {self.stream}

    def read(self):
        """Everything there is to read now."""
        while (item := self.stream.next()) is not None:
            if isinstance(item, FrameRecord):
                assert item.sequence == self.position + 1
                self.taken.append(item.sequence)
                self.position = item.sequence
            elif isinstance(item, StreamStart):
                last = self.taken[-1] if self.taken else 0
                assert item.discontinuity == (bool(last) and item.first_sequence > last + 1)
                self.position = item.first_sequence - 1
            elif item.kind is EventKind.FRAMES_SKIPPED:
                assert self.pacing is Pacing.REALTIME
                self.position += item.skipped_count

    def acknowledge(self):
        self.stream.acknowledge(self.taken[-1] if self.taken else 0, 1)


def play(pacing, doings):
    session = Session(
        SessionRecord("sessions/00", "token", "", WALKER.skeleton.id, 0.0, 60.0, 0.0),
        skeleton=WALKER.skeleton,
        state=STATE,
        ring_frames=RING,
        goal_tolerance=0.05,
        clock=lambda: 0.0,
    )
    reader = Reader(session, pacing)
    for doing in doings:
        if doing == "step":
            if session.wants(tick=True):
                session.advance(STATE, FRAME)
        elif doing == "reconnect":
            reader.connect()
        else:
            getattr(reader, doing)()
    reader.acknowledge()
    reader.read()
    return session, reader


@settings(max_examples=150, deadline=None)
@given(DOINGS)
def test_realtime_frames_rise_and_every_gap_is_counted(doings):
    session, reader = play(Pacing.REALTIME, doings)
    assert reader.taken == sorted(set(reader.taken))
    assert reader.position <= session.sequence


@settings(max_examples=150, deadline=None)
@given(DOINGS)
def test_credit_gives_every_frame_exactly_once(doings):
    session, reader = play(Pacing.CREDIT, doings)
    assert reader.taken == list(range(1, len(reader.taken) + 1))
    assert session.sequence - len(reader.taken) < RING


@settings(max_examples=150, deadline=None)
@given(DOINGS)
def test_burst_gives_every_frame_exactly_once(doings):
    session, reader = play(Pacing.BURST, doings)
    assert reader.taken == list(range(1, session.sequence + 1))
