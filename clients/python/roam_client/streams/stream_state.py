"""What a frame stream must remember to be resumed: shared by both clients, does no input or output itself.

stream                            StreamState
connect ─────────────────────────► opening()        messages to send first
each message received ───────────► receive(message) decoded item; answers to send are in `outbox`
control from the caller ─────────► control(input)   message to send now; kept until the server has it
connection broke ────────────────► opening()        again: continues after the last frame received
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from roam.v1 import motion_pb2

from roam_client.errors import WireError
from roam_client.types.frames import Event, EventType, Frame, Header
from roam_client.types.skeleton import Skeleton

REALTIME = motion_pb2.PACING_REALTIME
CREDIT = motion_pb2.PACING_CREDIT
BURST = motion_pb2.PACING_BURST

_ENCODINGS = {"float32": motion_pb2.ROTATION_ENCODING_FLOAT32, "snorm16": motion_pb2.ROTATION_ENCODING_SNORM16}
_PACINGS = {"realtime": REALTIME, "credit": CREDIT, "burst": BURST}

_SILENCE = 2.0  # [s] without a message after which a REALTIME stream goes on elsewhere
_LONGEST_SILENCE = 32.0  # [s]
_FRAMES_PER_ACK = 4  # well below any server's ack_window

Item = Header | Frame | Event


class ControlCounter:
    """Numbers the controls of one session 1, 2, 3, …, whichever way they are sent."""

    def __init__(self) -> None:
        self.last = 0
        self.paused = False  # whether this client holds the session: then no frames are due

    def next(self) -> int:
        """The next control_id."""
        self.last += 1
        return self.last

    def number(self, control: motion_pb2.ControlInput) -> motion_pb2.ControlInput:
        """A copy of a control with the next id."""
        numbered = motion_pb2.ControlInput()
        numbered.CopyFrom(control)
        numbered.control_id = self.next()
        if control.WhichOneof("input") == "playback":
            self.paused = control.playback.paused
        return numbered

    def at_least(self, value: int) -> None:
        """Skips ids that the server has already seen, for example from an earlier process."""
        self.last = max(self.last, value)


@dataclass
class StreamState:
    """Cursor, header and unconfirmed controls of one stream."""

    session: str
    counter: ControlCounter
    pacing: str = "realtime"  # realtime, credit or burst
    encoding: str = "float32"  # float32 or snorm16
    joint_positions: bool = False
    credit: int = 0  # frames granted ahead under credit pacing
    after_sequence: int = 0
    header: Header | None = None
    quiet: int = 0  # how often in a row the stream was resumed for its silence and brought no frame
    outbox: list[motion_pb2.AnimateRequest] = field(default_factory=list)
    ended: bool = False
    _skeleton: Skeleton | None = None
    _resume_token: str = ""
    _stream: str = ""
    _acknowledged: int = 0
    _unconfirmed: dict[int, motion_pb2.ControlInput] = field(default_factory=dict)

    @property
    def patience(self) -> float | None:
        """How long the next message may take before the connection counts as dead [s]; None: as long as it likes.

        In real time there is one every frame, but none while the session is held, perhaps by somebody else: whoever
        finds the stream silent again and again looks less and less often.
        """
        if self.pacing != "realtime" or self.counter.paused:
            return None
        return min(_LONGEST_SILENCE, _SILENCE * 2**self.quiet)

    def opening(self) -> motion_pb2.Open:
        """How to open the stream, or to continue it."""
        self.outbox.clear()
        return motion_pb2.Open(
            session=self.session,
            after_sequence=self.after_sequence,
            resume_token=self._resume_token,
            known_skeleton_id=self._skeleton.id if self._skeleton else "",
            rotation_encodings=[_ENCODINGS[self.encoding]],
            pacing=_PACINGS[self.pacing],
            credit=self.credit,
            joint_positions=self.joint_positions,
        )

    def control(self, control: motion_pb2.ControlInput) -> motion_pb2.AnimateRequest:
        """Numbers a control and keeps it until the server says that it has it."""
        numbered = self.counter.number(control)
        self._unconfirmed[numbered.control_id] = numbered
        return motion_pb2.AnimateRequest(control=numbered)

    def receive(self, message: motion_pb2.AnimateResponse) -> Item | None:
        """Decodes one message; None for one that is newer than this client, or a frame seen before."""
        match message.WhichOneof("message"):
            case "header":
                return self._receive_header(message.header)
            case "frame":
                return self._receive_frame(message.frame)
            case "event":
                return self._receive_event(message.event)
            case _:
                return None

    def _receive_header(self, message: motion_pb2.StreamHeader) -> Header:
        self.header = Header.from_message(message, known=self._skeleton)
        self._skeleton = self.header.skeleton
        self._resume_token = message.resume_token or self._resume_token
        self._confirm(message.last_control_id)
        self.counter.at_least(message.last_control_id)
        self._stream = message.stream
        self.outbox += [motion_pb2.AnimateRequest(control=c) for _, c in sorted(self._unconfirmed.items())]
        if self.pacing == "realtime":  # from the first Ack on, frames do not pile up on their way
            self._acknowledge(0)
        return self.header

    def _receive_frame(self, message: motion_pb2.Frame) -> Frame | None:
        if self.header is None:
            raise WireError("a frame came before the stream's header")
        if message.sequence <= self.after_sequence:
            return None
        self.after_sequence = message.sequence
        self.quiet = 0
        if self.pacing != "burst":
            self._acknowledge_frame()
        return Frame.from_message(message, self.header)

    def _receive_event(self, message: motion_pb2.SessionEvent) -> Event:
        event = Event.from_message(message)
        if event.type is EventType.CONTROL_APPLIED:
            self._unconfirmed.pop(event.control_id, None)
        self.ended = self.ended or event.type is EventType.SESSION_ENDED
        return event

    def _acknowledge_frame(self) -> None:
        """Every frame that was paid for; now and then in real time, which keeps the server's window as open."""
        if self.pacing == "credit":
            self._acknowledge(1)
        elif self.after_sequence >= self._acknowledged + _FRAMES_PER_ACK:
            self._acknowledge(0)

    def _acknowledge(self, credit: int) -> None:
        self._acknowledged = self.after_sequence
        ack = motion_pb2.Ack(sequence=self.after_sequence, credit=credit)
        self.outbox.append(motion_pb2.AnimateRequest(ack=ack))

    def acknowledgement(self, request: motion_pb2.AnimateRequest) -> motion_pb2.AcknowledgeRequest | None:
        """An acknowledgement as a call of its own, for a stream that cannot carry it; None where there is none."""
        if not request.HasField("ack") or not self._stream:
            return None
        return motion_pb2.AcknowledgeRequest(session=self.session, stream=self._stream, ack=request.ack)

    def _confirm(self, last_control_id: int) -> None:
        for control_id in [c for c in self._unconfirmed if c <= last_control_id]:
            del self._unconfirmed[control_id]

    def take_outbox(self) -> Sequence[motion_pb2.AnimateRequest]:
        """What must be sent now, once."""
        waiting, self.outbox = self.outbox, []
        return waiting
