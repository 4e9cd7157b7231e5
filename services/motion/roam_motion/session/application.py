"""The motion service's application object: what HTTP, gRPC and WebSocket all translate to."""

import asyncio
import re
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from functools import partial
from time import time
from typing import Protocol
from uuid import uuid4

import numpy as np
from prometheus_client import CollectorRegistry
from roam.v1 import motion_pb2, skeleton_pb2
from roam_character.pose import Pose
from roam_character.skeleton import Skeleton
from roam_serving.errors import DRAINING, INVALID_ARGUMENT, ServiceError
from roam_serving.logs import get_log, remember
from roam_serving.skeletons import SKELETON_NOT_FOUND

from roam_motion.animation.state import FRAME_RATE
from roam_motion.animator import CharacterState, FrameData, Intent
from roam_motion.api.messages import control_change, frame_message, header_message, pose_of, stream_options
from roam_motion.session.live import LiveSessions
from roam_motion.session.ownership import Ownership
from roam_motion.session.revival import revive
from roam_motion.session.session import FrameRecord, Session
from roam_motion.session.stepping import Frames, frames_of
from roam_motion.session.store.base import Claim, SessionRecord, SessionStore, StoreDownError
from roam_motion.session.store.memory import MemoryStore
from roam_motion.session.stream import FrameStream, Item, StreamStart
from roam_motion.session.stream_metrics import StreamMetrics
from roam_motion.session.ticker import Ticker
from roam_motion.settings import MotionSettings

log = get_log("roam_motion.session.application")

_LONGEST_REQUEST_ID = 64
_PAGE = 100
_GATEWAY_ID = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
_ALONE = 86400.0  # [s] lease where there is no other replica to take a session over


class StepsCharacters(Protocol):
    """`motion.step.Animator` as this service uses it."""

    def start(self, position_xz: Sequence[float], yaw: float, seed: int) -> CharacterState: ...
    def step(
        self, states: Sequence[CharacterState], intents: Sequence[Intent]
    ) -> list[tuple[CharacterState, FrameData]]: ...


class MotionApplication:
    """Sessions, the ticker that moves them, and the streams that read them. All methods run on the event loop.

    `frames` are computed by the animator unless something else does; `build` names what. `restore` reads a character's
    state back. With a shared `store` other replicas take sessions over when this one is gone.
    """

    def __init__(
        self,
        animator: StepsCharacters,
        skeleton: Skeleton,
        header_skeleton: skeleton_pb2.Skeleton,
        settings: MotionSettings,
        registry: CollectorRegistry,
        *,
        clock: Callable[[], float] = time,
        store: SessionStore | None = None,
        restore: Callable[[bytes], CharacterState] = CharacterState.from_bytes,
        frames: Frames | None = None,
        build: str = "",
        on_health: Callable[[bool], None] = lambda well: None,
    ) -> None:
        self.settings = settings
        self.sessions = LiveSessions(settings.max_sessions, clock)
        self.ownership = Ownership(
            store or MemoryStore(),
            self.sessions,
            self._revive,
            build=build,
            lease=settings.session_lease if store else _ALONE,
            snapshot_frames=settings.snapshot_frames,
            history_frames=settings.history_frames,
            on_health=on_health,
            on_progress=lambda: self.ticker.wake(),
        )
        frames = frames or partial(frames_of, animator.step)
        self.ticker = Ticker(self.sessions, self.ownership, frames, frame_rate=FRAME_RATE, registry=registry)
        self._metrics = StreamMetrics(registry)
        self._animator = animator
        self._skeleton = skeleton
        self._header_skeleton = header_skeleton
        self._restore = restore
        self._build = build
        self._clock = clock
        self._on_health = on_health
        self._draining = False
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        """Takes the lease, and starts renewing it and ticking."""
        with suppress(StoreDownError):  # the first renewal in the background tells
            await self.ownership.renew()
        self._tasks = [
            asyncio.create_task(self.ownership.run(), name="motion-ownership"),
            asyncio.create_task(self.ticker.run(), name="motion-ticker"),
        ]
        for task in self._tasks:
            task.add_done_callback(self._note_end)

    async def close(self) -> None:
        """Stops both."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self.ticker.close()
        await self.ownership.close()

    async def drain(self) -> None:
        """Takes no new sessions or streams, ends the streams there are, and gives every session up."""
        self._draining = True
        await asyncio.gather(*(self.ownership.release(session) for session in self.sessions))

    async def create_session(self, request: motion_pb2.CreateSessionRequest, offered_id: str = "") -> Session:
        """A new session, or the same one for a request_id seen before.

        `offered_id`: what the request's x-roam-session says; taken where a gateway in front sets it, to route by it.
        """
        self._check_open()
        if len(request.request_id) > _LONGEST_REQUEST_ID:
            detail = f"at most {_LONGEST_REQUEST_ID} characters"
            raise ServiceError(INVALID_ARGUMENT, detail, field="request_id")
        if request.skeleton_id not in ("", self._skeleton.id):
            detail = f"this server animates {self._skeleton.id}"
            raise ServiceError(SKELETON_NOT_FOUND, detail, field="skeleton_id")
        position, yaw = self._placement(request)
        record = SessionRecord(
            name=f"sessions/{self._new_id(offered_id)}",
            resume_token=uuid4().hex,
            request_id=request.request_id,
            skeleton_id=self._skeleton.id,
            create_time=self._clock(),
            idle_timeout=self._idle_timeout(request),
            floor_height=_finite(request.floor_height, "floor_height"),
        )
        self.ticker.sweep()
        session = await self.ownership.create(self._session(record, self._animator.start(position, yaw, request.seed)))
        session.touch()
        return session

    async def get_session(self, name: str) -> Session:
        """A live session; its idle timeout starts again."""
        session = await self._hold(name)
        session.touch()
        return session

    def list_sessions(self, page_size: int, page_token: str) -> tuple[list[Session], str]:
        """A page of the sessions that this replica holds, in order of creation, and the token of the next page."""
        sessions = list(self.sessions)
        try:
            start = int(page_token or 0)
        except ValueError:
            raise ServiceError(INVALID_ARGUMENT, "page_token is not one of ours", field="page_token") from None
        if start < 0 or page_size < 0:
            raise ServiceError(INVALID_ARGUMENT, "page_size must not be negative", field="page_size")
        end = start + min(page_size or _PAGE, _PAGE)
        return sessions[start:end], str(end) if end < len(sessions) else ""

    async def delete_session(self, name: str) -> None:
        """Ends a session and frees its place at once."""
        await self.ownership.delete(await self._hold(name))

    async def control(self, name: str, control: motion_pb2.ControlInput) -> int:
        """Applies a control; returns the first sequence it can affect. It is written down before it takes effect."""
        session = await self.get_session(name)
        change = control_change(control, session)
        async with session.one_control:
            known = session.answer(control.control_id)
            if known is not None:
                return known
            with session.hold():
                entry = session.entry(control)
                await self.ownership.record(session, entry)
                session.accept(entry, change)
        self.ticker.wake()
        return entry.effective

    @asynccontextmanager
    async def stream(self, opening: motion_pb2.Open) -> AsyncIterator[FrameStream]:
        """Connects a reader to a session for the time of the `async with` block."""
        self._check_open()
        remember(session=opening.session)
        here = self.sessions.get(opening.session) is not None
        session = await self.ownership.hold(
            opening.session, after_sequence=opening.after_sequence, insist=bool(opening.resume_token)
        )
        if session.lacks(opening.after_sequence):
            session = await self.ownership.rewind(session, opening.after_sequence)
        if opening.resume_token == session.record.resume_token:
            session.catch_up(opening.after_sequence)
            self._metrics.resumed(here=here)
        options = stream_options(opening, burst_frames=self.settings.burst_frames, ack_window=self.settings.ack_window)
        count = self._metrics.reader(realtime=options.pacing == motion_pb2.PACING_REALTIME)
        stream = FrameStream(session, options, self.ticker.wake, count)
        session.streams.add(stream)
        self.ticker.wake()
        try:
            yield stream
        finally:
            session.streams.discard(stream)
            session.touch()
            self.ticker.wake()

    def acknowledge(self, name: str, stream_id: str, ack: motion_pb2.Ack) -> None:
        """Acknowledges frames of one stream. One that is not known is no error: it may just have ended."""
        session = self.sessions.get(name)
        for stream in session.streams if session else ():
            if stream.id == stream_id:
                stream.acknowledge(ack.sequence, ack.credit)

    def response(self, stream: FrameStream, item: Item) -> motion_pb2.AnimateResponse:
        """An item of a stream as the message that carries it."""
        if isinstance(item, FrameRecord):
            return frame_message(item, stream.session, stream.options)
        if isinstance(item, StreamStart):
            header = header_message(stream, item, self._header_skeleton)
            return motion_pb2.AnimateResponse(header=header)
        return motion_pb2.AnimateResponse(event=item)

    def _note_end(self, task: asyncio.Task[None]) -> None:
        """A background task that ends by itself is a mistake; no session would move any more, so readiness tells."""
        if not task.cancelled():
            log.critical("background task ended", task=task.get_name(), exc_info=task.exception())
            self._on_health(False)

    def _session(self, record: SessionRecord, state: CharacterState) -> Session:
        return Session(
            record,
            skeleton=self._skeleton,
            state=state,
            ring_frames=self.settings.ring_frames,
            goal_tolerance=self.settings.goal_tolerance,
            clock=self._clock,
        )

    def _revive(self, claim: Claim, after_sequence: int) -> Session:
        return revive(
            claim,
            after_sequence,
            build=self._build,
            reach=self.ownership.reach,
            make=lambda snapshot: self._session(claim.record, self._restore(snapshot.state)),
        )

    async def _hold(self, name: str) -> Session:
        remember(session=name)
        # A gateway that routes by session says with every request where the session belongs: after a replica came
        # back, its sessions come home to it.
        return await self.ownership.hold(name, insist=self.settings.session_header)

    def _new_id(self, offered: str) -> str:
        trusted = self.settings.session_header and _GATEWAY_ID.fullmatch(offered)
        return offered if trusted else uuid4().hex

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
