"""The motion service's application object: what HTTP, gRPC and WebSocket all translate to."""

import asyncio
import re
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from functools import partial
from time import time
from typing import Protocol
from uuid import uuid4

from prometheus_client import CollectorRegistry
from roam_character.skeleton import Skeleton
from roam_character.volume import Volume
from roam_serving.access import CALLER, OWNER
from roam_serving.endpoints.skeletons import SKELETON_NOT_FOUND
from roam_serving.errors import DRAINING, INVALID_ARGUMENT, ServiceError
from roam_serving.monitoring.logs import get_log, remember

from roam_motion.animation.state import FRAME_RATE
from roam_motion.animator import CharacterState, FrameData, Intent
from roam_motion.control.intent import Goal
from roam_motion.control.paths import Outline
from roam_motion.errors import SESSION_QUOTA
from roam_motion.session.control_desk import ControlDesk
from roam_motion.session.ownership import LiveSessions, Ownership
from roam_motion.session.records import ControlRequest, SessionRecord, SessionRequest
from roam_motion.session.session import Session
from roam_motion.session.store.base import SessionStore, StoreDownError
from roam_motion.session.store.memory import MemoryStore
from roam_motion.session.stream import FrameStream, Pacing, StreamMetrics, StreamOptions
from roam_motion.session.ticker import Ticker
from roam_motion.session.worker import Frames, frames_of
from roam_motion.settings import MotionSettings

log = get_log("roam_motion.session.application")

_LONGEST_REQUEST_ID = 64
_PAGE = 100
_GATEWAY_ID = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
_ALONE = 86400.0  # [s] lease where there is no other replica to take a session over


class StepsCharacters(Protocol):
    """`Animator` as this service uses it."""

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
        settings: MotionSettings,
        registry: CollectorRegistry,
        *,
        clock: Callable[[], float] = time,
        store: SessionStore | None = None,
        restore: Callable[[bytes, Volume | None], CharacterState] = CharacterState.joined,
        frames: Frames | None = None,
        build: str = "",
        check_goal: Callable[[Goal, tuple[float, float]], None] = lambda goal, start: None,
        left_behind: Callable[[Intent], tuple[Outline, ...]] = lambda intent: (),
        on_health: Callable[[bool], None] = lambda well: None,
        on_failure: Callable[[str], None] = lambda reason: None,
    ) -> None:
        self.settings = settings
        self.sessions = LiveSessions(settings.max_sessions, clock)
        self.ownership = Ownership(
            store or MemoryStore(),
            self.sessions,
            lambda claim, snapshot: self._session(claim.record, restore(snapshot.state, snapshot.volume)),
            build=build,
            lease=settings.session_lease if store else _ALONE,
            snapshot_frames=settings.snapshot_frames,
            history_frames=settings.history_frames,
            on_health=on_health,
            on_progress=lambda: self.ticker.wake(),
        )
        frames = frames or partial(frames_of, animator.step)
        self.ticker = Ticker(
            self.sessions, self.ownership, frames, frame_rate=FRAME_RATE, registry=registry, on_failure=on_failure
        )
        self._desk = ControlDesk(self.sessions, settings, check_goal, left_behind)
        self._metrics = StreamMetrics(registry)
        self._animator = animator
        self.skeleton = skeleton
        self._clock = clock
        self._on_failure = on_failure
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

    async def create_session(self, request: SessionRequest, offered_id: str = "") -> Session:
        """A new session, or the same one for a request_id seen before.

        `offered_id`: what the request's x-roam-session says; taken where a gateway in front sets it, to route by it.
        """
        self._check_open()
        if len(request.request_id) > _LONGEST_REQUEST_ID:
            detail = f"at most {_LONGEST_REQUEST_ID} characters"
            raise ServiceError(INVALID_ARGUMENT, detail, field="request_id")
        if request.skeleton_id not in ("", self.skeleton.id):
            detail = f"this server animates {self.skeleton.id}"
            raise ServiceError(SKELETON_NOT_FOUND, detail, field="skeleton_id")
        record = SessionRecord(
            name=f"sessions/{self._new_id(offered_id)}",
            resume_token=uuid4().hex,
            request_id=request.request_id,
            skeleton_id=self.skeleton.id,
            create_time=self._clock(),
            idle_timeout=self._idle_timeout(request.idle_timeout),
            floor_height=request.floor_height,
            owner=OWNER.get(),
        )
        self.ticker.sweep()
        self._check_quota()
        state = self._animator.start(request.position, request.yaw, request.seed)
        session = await self.ownership.create(self._session(record, state))
        session.touch()
        return session

    async def get_session(self, name: str) -> Session:
        """A live session; its idle timeout starts again."""
        session = await self._hold(name)
        session.touch()
        return session

    def list_sessions(self, page_size: int, page_token: str) -> tuple[list[Session], str]:
        """A page of the caller's sessions that this replica holds, oldest first, and the token of the next page."""
        sessions = [session for session in self.sessions if session.record.owner == OWNER.get()]
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

    async def control(self, name: str, control: ControlRequest) -> int:
        """Applies a control; returns the first sequence it can affect. It is written down before it takes effect.

        GOAL_INVALID, GOAL_UNREACHABLE, RATE_LIMITED, CONTROL_BUDGET.
        """
        session = await self.get_session(name)
        async with session.one_control:
            known = session.answer(control.control_id)
            if known is not None:
                return known
            control, warnings = await self._desk.checked(session, control)
            with session.hold():
                entry = session.entry(control)
                self._desk.afford(session, entry)
                await self.ownership.record(session, entry)
                session.accept(entry)
            for warning in warnings:
                session.announce(replace(warning, sequence=entry.effective), after=0)
        self.ticker.wake()
        return entry.effective

    @asynccontextmanager
    async def stream(self, name: str, options: StreamOptions) -> AsyncIterator[FrameStream]:
        """Connects a reader to a session for the time of the `async with` block."""
        self._check_open()
        remember(session=name)
        here = self.sessions.get(name) is not None
        after = options.after_sequence
        # Whoever had frames is the session's reader: the session comes to where its reader is, token or not.
        insist = bool(after or options.resume_token)
        session = await self.ownership.hold(name, OWNER.get(), after_sequence=after, insist=insist)
        if session.lacks(after):
            session = await self.ownership.rewind(session, after)
        if insist:
            session.catch_up(after)
            self._metrics.resumed(here=here)
        options = replace(options, burst_frames=self.settings.burst_frames, ack_window=self.settings.ack_window)
        count = self._metrics.reader(realtime=options.pacing is Pacing.REALTIME)
        stream = FrameStream(session, options, self.ticker.wake, count)
        session.streams.add(stream)
        if after and not here:  # what the replica before had accepted, and may not have told
            for event in session.applied_after(after):
                stream.put_event(event, after=0)
        self.ticker.wake()
        try:
            yield stream
        finally:
            session.streams.discard(stream)
            session.touch()
            self.ticker.wake()

    def acknowledge(self, name: str, stream_id: str, sequence: int, credit: int) -> None:
        """Acknowledges frames of one stream. One that is not known is no error: it may just have ended."""
        session = self.sessions.get(name)
        for stream in session.streams if session and session.record.owner == OWNER.get() else ():
            if stream.id == stream_id:
                stream.acknowledge(sequence, credit)

    def _note_end(self, task: asyncio.Task[None]) -> None:
        """A background task that ends by itself is a mistake; no session would move any more, so liveness tells."""
        if not task.cancelled():
            log.critical("background task ended", task=task.get_name(), exc_info=task.exception())
            self._on_failure(f"{task.get_name()} has ended: {task.exception()!r}")

    def _session(self, record: SessionRecord, state: CharacterState) -> Session:
        return Session(
            record,
            skeleton=self.skeleton,
            state=state,
            ring_frames=self.settings.ring_frames,
            goal_tolerance=self.settings.goal_tolerance,
            clock=self._clock,
        )

    async def _hold(self, name: str) -> Session:
        remember(session=name)
        # A gateway that routes by session says with every request where the session belongs: after a replica came
        # back, its sessions come home to it.
        return await self.ownership.hold(name, OWNER.get(), insist=self.settings.session_header)

    def _check_quota(self) -> None:
        """SESSION_QUOTA when the caller has as many sessions as one caller may have."""
        most = self.settings.caller_sessions
        if most and sum(session.caller == CALLER.get() for session in self.sessions) >= most:
            raise ServiceError(SESSION_QUOTA, f"one caller may have {most} sessions", retry_after=1.0)

    def _new_id(self, offered: str) -> str:
        trusted = self.settings.session_header and _GATEWAY_ID.fullmatch(offered)
        return offered if trusted else uuid4().hex

    def _check_open(self) -> None:
        if self._draining:
            raise ServiceError(DRAINING, retry_after=1.0)

    def _idle_timeout(self, seconds: float | None) -> float:
        if seconds is None:
            return self.settings.idle_timeout
        longest = self.settings.max_idle_timeout
        if not 0 < seconds <= longest:
            raise ServiceError(INVALID_ARGUMENT, f"must be above 0 and at most {longest:g} s", field="idle_timeout")
        return seconds
