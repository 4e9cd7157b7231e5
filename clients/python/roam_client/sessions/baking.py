"""When a baked motion is complete: shared by both clients, does no input or output itself."""

from collections.abc import Callable
from dataclasses import dataclass, field

from roam.v1 import motion_pb2

from roam_client.sessions.controls import stand_up
from roam_client.streams.stream_state import Item
from roam_client.types.actions import Action
from roam_client.types.frames import Event, EventType, Frame, Header
from roam_client.types.goal_poses import GoalPose
from roam_client.types.motions import Motion

OnFrame = Callable[[Frame], None]

# Standing up takes under three seconds; a session that never gets idle must not bake for ever.
_STAND_UP_LIMIT = 5.0  # [s]


@dataclass
class Bake:
    """Collects a walk to a goal pose: until it is reached and held, and optionally until the character stands again.

    `hold` [s] after the goal is reached; `max_frames` caps everything.
    """

    goal: GoalPose
    hold: float = 1.0
    stand_up: bool = False
    max_frames: int = 900
    on_frame: OnFrame | None = None
    header: Header | None = None
    frames: list[Frame] = field(default_factory=list)
    goal_reached: int | None = None
    done: bool = False
    _reached_sequence: int | None = None
    _rising_since: int | None = None

    def add(self, item: Item) -> motion_pb2.ControlInput | None:
        """Takes the next item of the stream; a control to send, if it is time for one."""
        if isinstance(item, Header):
            self.header = item
        elif isinstance(item, Event):
            self._note(item)
        elif not self.done:
            return self._add_frame(item)
        return None

    def _note(self, event: Event) -> None:
        if event.type is EventType.GOAL_REACHED and self._reached_sequence is None:
            self._reached_sequence = event.sequence
        self.done = self.done or event.type is EventType.SESSION_ENDED

    def _add_frame(self, frame: Frame) -> motion_pb2.ControlInput | None:
        self.frames.append(frame)
        if self.on_frame is not None:
            self.on_frame(frame)
        count = len(self.frames)
        self.done = count >= self.max_frames
        if self.goal_reached is None and self._reached_sequence is not None:
            self.goal_reached = min(count - 1, self._reached_sequence - self.frames[0].sequence)
        if self.goal_reached is None or self.header is None:
            return None
        rate = self.header.frame_rate
        if self._rising_since is not None:
            self.done = self.done or self._risen(rate)
        elif count - self.goal_reached > self.hold * rate:
            if not self.stand_up:
                self.done = True
            elif not self.done:
                self._rising_since = count
                return stand_up()
        return None

    def _risen(self, rate: float) -> bool:
        """Idle for half a second since the order, or out of time."""
        assert self._rising_since is not None
        risen = self.frames[self._rising_since :]
        tail = risen[-round(rate / 2) :]
        idle = len(tail) >= round(rate / 2) and all(frame.action is Action.IDLE for frame in tail)
        return idle or len(risen) > _STAND_UP_LIMIT * rate

    @property
    def pacing(self) -> str:
        """As fast as frames are computed, or by credit where a later control must hit the same frame every time."""
        return "credit" if self.stand_up else "burst"

    def motion(self) -> Motion:
        """The frames so far. ValueError when there are none."""
        if self.header is None or not self.frames:
            raise ValueError("the stream ended before its first frame")
        return Motion.from_frames(
            self.frames,
            skeleton=self.header.skeleton,
            frame_rate=self.header.frame_rate,
            goal=self.goal,
            goal_reached=self.goal_reached,
        )
