"""The motion service's application object: what HTTP, gRPC and WebSocket all translate to."""

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import time
from typing import Protocol

import numpy as np
from character.pose import Pose
from character.skeleton import Skeleton
from prometheus_client import CollectorRegistry
from roam.v1 import motion_pb2, skeleton_pb2
from serving.errors import DRAINING, INVALID_ARGUMENT, ServiceError
from serving.skeletons import SKELETON_NOT_FOUND

from motion.messages import control_change, frame_message, header_message, pose_of, stream_options
from motion.sessions import Event, FrameRecord, Session, SessionStore
from motion.settings import MotionSettings
from motion.state import FRAME_RATE
from motion.step import CharacterState, FrameData, Intent
from motion.stream import FrameStream, Item, StreamStart
from motion.ticker import Ticker

_LONGEST_REQUEST_ID = 64
_PAGE = 100


class StepsCharacters(Protocol):
    """`motion.step.Animator` as this service uses it."""

    def start(self, position_xz: Sequence[float], yaw: float, seed: int) -> CharacterState: ...
    def step(
        self, states: Sequence[CharacterState], intents: Sequence[Intent]
    ) -> list[tuple[CharacterState, FrameData]]: ...


class MotionApplication:
    """Sessions, the ticker that moves them, and the streams that read them. All methods run on the event loop."""

    def __init__(
        self,
        animator: StepsCharacters,
        skeleton: Skeleton,
        header_skeleton: skeleton_pb2.Skeleton,
        settings: MotionSettings,
        registry: CollectorRegistry,
        clock: Callable[[], float] = time,
    ) -> None:
        self.settings = settings
        self.sessions = SessionStore(settings.max_sessions, clock)
        self.ticker = Ticker(self.sessions, animator.step, frame_rate=FRAME_RATE, registry=registry)
        self._animator = animator
        self._skeleton = skeleton
        self._header_skeleton = header_skeleton
        self._clock = clock
        self._draining = False
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Starts ticking."""
        self._task = asyncio.create_task(self.ticker.run(), name="motion-ticker")

    async def close(self) -> None:
        """Stops ticking."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.wait([self._task])
        self.ticker.close()

    def drain(self) -> None:
        """Takes no new sessions or streams, tells connected readers and ends their streams."""
        self._draining = True
        event = Event(type=motion_pb2.EVENT_TYPE_DRAINING, message="the server is shutting down; reconnect")
        event.reconnect_within.FromSeconds(10)
        for session in self.sessions:
            event.sequence = session.sequence
            session.announce(event, after=0)
            for stream in session.streams:
                stream.finish()

    def create_session(self, request: motion_pb2.CreateSessionRequest) -> Session:
        """A new session, or the one that the same request_id made before."""
        self._check_open()
        if len(request.request_id) > _LONGEST_REQUEST_ID:
            detail = f"at most {_LONGEST_REQUEST_ID} characters"
            raise ServiceError(INVALID_ARGUMENT, detail, field="request_id")
        if known := self.sessions.of_request(request.request_id):
            known.touch()
            return known
        skeleton = self._skeleton
        if request.skeleton_id not in ("", skeleton.id):
            detail = f"this server animates {skeleton.id}"
            raise ServiceError(SKELETON_NOT_FOUND, detail, field="skeleton_id")
        position, yaw = self._placement(request)
        idle_timeout = self._idle_timeout(request)
        floor_height = _finite(request.floor_height, "floor_height")
        self.sessions.check_quota()
        session = Session(
            skeleton=skeleton,
            state=self._animator.start(position, yaw, request.seed),
            floor_height=floor_height,
            idle_timeout=idle_timeout,
            ring_frames=self.settings.ring_frames,
            goal_tolerance=self.settings.goal_tolerance,
            clock=self._clock,
        )
        self.sessions.add(session, request.request_id)
        return session

    def get_session(self, name: str) -> Session:
        """A live session; its idle timeout starts again."""
        session = self.sessions.get(name)
        session.touch()
        return session

    def list_sessions(self, page_size: int, page_token: str) -> tuple[list[Session], str]:
        """A page of sessions in order of creation, and the token of the next page."""
        sessions = list(self.sessions)
        try:
            start = int(page_token or 0)
        except ValueError:
            raise ServiceError(INVALID_ARGUMENT, "page_token is not one of ours", field="page_token") from None
        if start < 0 or page_size < 0:
            raise ServiceError(INVALID_ARGUMENT, "page_size must not be negative", field="page_size")
        end = start + min(page_size or _PAGE, _PAGE)
        return sessions[start:end], str(end) if end < len(sessions) else ""

    def delete_session(self, name: str) -> None:
        """Ends a session and frees its slot at once."""
        self.sessions.remove(name, "deleted")

    def control(self, name: str, control: motion_pb2.ControlInput) -> int:
        """Applies a control; returns the first sequence it can affect."""
        session = self.get_session(name)
        effective = session.control(control.control_id, control_change(control, session))
        self.ticker.wake()
        return effective

    @contextmanager
    def stream(self, opening: motion_pb2.Open) -> Iterator[FrameStream]:
        """Connects a reader to a session for the time of the `with` block."""
        self._check_open()
        session = self.get_session(opening.session)
        options = stream_options(opening, burst_frames=self.settings.burst_frames, ack_window=self.settings.ack_window)
        stream = FrameStream(session, options, self.ticker.wake)
        session.streams.add(stream)
        self.ticker.wake()
        try:
            yield stream
        finally:
            session.streams.discard(stream)
            session.touch()
            self.ticker.wake()

    def response(self, stream: FrameStream, item: Item) -> motion_pb2.AnimateResponse:
        """An item of a stream as the message that carries it."""
        if isinstance(item, FrameRecord):
            return motion_pb2.AnimateResponse(frame=frame_message(item, stream.session, stream.options))
        if isinstance(item, StreamStart):
            header = header_message(stream.session, stream.options, item, self._header_skeleton)
            return motion_pb2.AnimateResponse(header=header)
        return motion_pb2.AnimateResponse(event=item)

    def _check_open(self) -> None:
        if self._draining:
            raise ServiceError(DRAINING, retry_after=1.0)

    def _placement(self, request: motion_pb2.CreateSessionRequest) -> tuple[tuple[float, float], float]:
        if request.WhichOneof("start") == "start_pose":
            pose: Pose = pose_of(request.start_pose, self._skeleton, field="start_pose")
            return (float(pose.root_position[0]), float(pose.root_position[2])), pose.yaw()
        place = request.start_placement
        x, z = _finite(place.x, "start_placement.x"), _finite(place.z, "start_placement.z")
        return (x, z), _finite(place.yaw, "start_placement.yaw")

    def _idle_timeout(self, request: motion_pb2.CreateSessionRequest) -> float:
        if not request.HasField("idle_timeout"):
            return self.settings.idle_timeout
        seconds: float = request.idle_timeout.ToMilliseconds() / 1000
        longest = self.settings.max_idle_timeout
        if not 0 < seconds <= longest:
            raise ServiceError(INVALID_ARGUMENT, f"must be above 0 and at most {longest:g} s", field="idle_timeout")
        return seconds


def _finite(value: float, field: str) -> float:
    if not np.isfinite(value) or abs(value) > 1e4:
        raise ServiceError(INVALID_ARGUMENT, f"{field} must be a number of metres or radians below 10000", field=field)
    return value
