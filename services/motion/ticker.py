"""One ticker steps every session that is due in ONE batched forward pass, off the event loop."""

import asyncio
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram
from serving.logs import get_log

from motion.sessions import Session, SessionStore
from motion.step import CharacterState, FrameData, Intent

log = get_log("motion.ticker")

Step = Callable[[Sequence[CharacterState], Sequence[Intent]], list[tuple[CharacterState, FrameData]]]

_SWEEP_SECONDS = 1.0


class TickerMetrics:
    """What the ticker tells Prometheus."""

    def __init__(self, registry: CollectorRegistry) -> None:
        self.ticks = Counter("roam_motion_ticks", "Batched steps made.", registry=registry)
        self.overruns = Counter("roam_motion_overruns", "Ticks that came late.", registry=registry)
        self.frames = Counter("roam_motion_frames", "Frames computed.", registry=registry)
        self.failures = Counter("roam_motion_step_failures", "Sessions ended by an error.", registry=registry)
        self.sessions = Gauge("roam_motion_sessions", "Sessions alive.", registry=registry)
        self.streams = Gauge("roam_motion_streams", "Streams connected.", registry=registry)
        self.step_seconds = Histogram(
            "roam_motion_step_seconds",
            "Time of one batched step.",
            buckets=(0.002, 0.005, 0.01, 0.02, 0.033, 0.05, 0.1, 0.25, 1),
            registry=registry,
        )
        self.batch = Histogram(
            "roam_motion_batch_sessions", "Sessions in one step.", buckets=(1, 2, 4, 8, 16, 32, 64), registry=registry
        )


class Ticker:
    """Runs as one task; sessions with REALTIME readers move on the tick, others when their readers ask."""

    def __init__(self, store: SessionStore, step: Step, *, frame_rate: float, registry: CollectorRegistry) -> None:
        self._store = store
        self._step = step
        self._interval = 1 / frame_rate
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="motion-step")
        self._awake = asyncio.Event()
        self.metrics = TickerMetrics(registry)

    def wake(self) -> None:
        """Something changed: a reader came, gave credit or took frames."""
        self._awake.set()

    def close(self) -> None:
        """Frees the thread."""
        self._executor.shutdown(wait=False, cancel_futures=True)

    async def run(self) -> None:
        """Ticks until cancelled."""
        loop = asyncio.get_running_loop()
        next_tick = next_sweep = loop.time()
        while True:
            now = loop.time()
            if now >= next_sweep:
                next_sweep = now + _SWEEP_SECONDS
                self._sweep()
            tick = now >= next_tick
            if tick:
                next_tick = self._following(next_tick, now)
            self._awake.clear()
            due = [session for session in self._store if session.wants_step(tick=tick)]
            if due:
                await self.step(due)
            else:
                await self._sleep(next_tick if self._any_realtime() else next_sweep)

    async def step(self, sessions: Sequence[Session]) -> None:
        """One batched step of some sessions; a session whose step fails is ended, the others go on."""
        for session in sessions:
            session.stepping = True
        loop = asyncio.get_running_loop()
        start = perf_counter()
        try:
            results = await loop.run_in_executor(self._executor, self._compute, sessions)
        finally:
            for session in sessions:
                session.stepping = False
        self.metrics.step_seconds.observe(perf_counter() - start)
        self.metrics.ticks.inc()
        self.metrics.batch.observe(len(sessions))
        for session, result in zip(sessions, results, strict=True):
            self._take(session, result)

    def _compute(self, sessions: Sequence[Session]) -> Sequence[tuple[CharacterState, FrameData] | Exception]:
        states = [session.state for session in sessions]
        intents = [session.intent for session in sessions]
        try:
            return self._step(states, intents)
        except Exception as error:
            if len(sessions) == 1:
                return [error]
            return [result for session in sessions for result in self._compute([session])]

    def _take(self, session: Session, result: tuple[CharacterState, FrameData] | Exception) -> None:
        if session.ended:
            return
        try:
            if isinstance(result, Exception):
                raise result
            session.advance(*result)
            self.metrics.frames.inc()
        except Exception as error:
            log.error("session ended by an error", session=session.name, exc_info=error)
            self.metrics.failures.inc()
            self._store.remove(session.name, f"internal error: {type(error).__name__}")

    def _following(self, tick: float, now: float) -> float:
        """Time of the next tick; a late ticker does not run after what it missed, session time stretches instead."""
        following = tick + self._interval
        if following > now:
            return following
        if self._any_realtime():
            self.metrics.overruns.inc()
        return now + self._interval

    def _any_realtime(self) -> bool:
        return any(stream.realtime for session in self._store for stream in session.streams)

    def _sweep(self) -> None:
        self._store.drop_expired()
        self.metrics.sessions.set(len(self._store))
        self.metrics.streams.set(sum(len(session.streams) for session in self._store))

    async def _sleep(self, until: float) -> None:
        """Sleeps until a loop time or the next wake."""
        delay = until - asyncio.get_running_loop().time()
        if delay <= 0:
            return
        try:
            async with asyncio.timeout(delay):
                await self._awake.wait()
        except TimeoutError:
            pass
