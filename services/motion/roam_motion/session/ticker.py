"""One ticker steps every session that is due in ONE batched forward pass, off the event loop."""

import asyncio
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram
from roam_serving.monitoring.logs import get_log

from roam_motion.session.ownership import LiveSessions, Ownership
from roam_motion.session.session import Session
from roam_motion.session.worker import Frames, Result

log = get_log("roam_motion.session.ticker")

_SWEEP_SECONDS = 1.0
_LONGEST_WAIT = 0.7  # of a tick, from which on no frame waits to be shown
_SLOWER, _QUICKER = 0.25, 0.01  # shares by which the pace follows steps that take longer, and less long
_HOPELESS = 20  # failed ticks in a row: 7 s, and as many new worker processes
_FRAMES_AHEAD = 8  # most frames of one trip to the thread, where nobody waits for the next tick


class TickerMetrics:
    """What the ticker tells Prometheus."""

    def __init__(self, registry: CollectorRegistry) -> None:
        self.ticks = Counter("roam_motion_ticks", "Batched steps made.", registry=registry)
        self.overruns = Counter("roam_motion_overruns", "Ticks that came late.", registry=registry)
        self.frames = Counter("roam_motion_frames", "Frames computed.", registry=registry)
        self.errors = Counter("roam_motion_tick_errors", "Ticks that failed as a whole.", registry=registry)
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


class Pace:
    """How long after its tick a frame is shown: about as long as all but the slowest steps take of late.

    Steps of 4 to 8 ms, each shown when it is done, would come unevenly; a reader sees a tick as even as the clock.
    """

    def __init__(self, most: float) -> None:
        self._most = most  # [s]
        self.after = 0.0  # [s]

    def wait(self, taken: float) -> float:
        """How much longer a frame waits that is ready `taken` after its tick [s]."""
        share = _SLOWER if taken > self.after else _QUICKER
        self.after = min(self.after + share * (taken - self.after), self._most)
        return max(0.0, self.after - taken)


class Ticker:
    """Runs as one task; sessions with REALTIME readers move on the tick, others when their readers ask."""

    def __init__(
        self,
        live: LiveSessions,
        ownership: Ownership,
        frames: Frames,
        *,
        frame_rate: float,
        registry: CollectorRegistry,
        on_failure: Callable[[str], None] = lambda reason: None,
    ) -> None:
        self._live = live
        self._on_failure = on_failure
        self._next_tick = self._next_sweep = 0.0  # [s] of the loop's clock
        self._ownership = ownership
        self._frames = frames
        self._interval = 1 / frame_rate
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="motion-step")
        self._awake = asyncio.Event()
        self._pace = Pace(_LONGEST_WAIT * self._interval)
        self.metrics = TickerMetrics(registry)

    def wake(self) -> None:
        """Something changed: a reader came, gave credit or took frames."""
        self._awake.set()

    def close(self) -> None:
        """Frees the thread."""
        self._executor.shutdown(wait=False, cancel_futures=True)

    async def run(self) -> None:
        """Ticks until cancelled; an error costs the ticks that it took, nothing else.

        `on_failure` hears of it when no tick succeeds for long: then only a new process helps.
        """
        self._next_tick = self._next_sweep = asyncio.get_running_loop().time()
        failures = 0
        while True:
            try:
                await self._tick()
                failures = 0
            except Exception as error:
                failures += 1
                self.metrics.errors.inc()
                log.error("a tick failed", failures=failures, exc_info=error)
                if failures == _HOPELESS:
                    self._on_failure(f"{failures} ticks failed in a row: {type(error).__name__}: {error}")
                await asyncio.sleep(self._interval * failures)

    async def _tick(self) -> None:
        """One turn: sweeps, steps what is due, or sleeps until something is."""
        now = asyncio.get_running_loop().time()
        if now >= self._next_sweep:
            self._next_sweep = now + _SWEEP_SECONDS
            self.sweep()
        tick = now >= self._next_tick
        if tick:
            self._next_tick = self._following(self._next_tick, now)
        self._awake.clear()
        due, frames = self._due(tick)
        if due:
            await self.step(due, frames, tick=self._next_tick - self._interval if tick else None)
        else:
            await self._sleep(self._next_tick if self._any_realtime() else self._next_sweep)

    def _due(self, tick: bool) -> tuple[list[Session], int]:
        """The sessions to step now, and by how many frames: several where that makes no tick late."""
        if not self._ownership.valid:
            return [], 0
        wanted = {session: frames for session in self._live if (frames := session.wants(tick=tick))}
        ahead = 1 if self._any_realtime() else _FRAMES_AHEAD
        return list(wanted), min([ahead, *wanted.values()])

    async def step(self, sessions: Sequence[Session], frames: int = 1, tick: float | None = None) -> None:
        """Some batched steps of some sessions; a session whose step fails is ended, the others go on.

        Frames of a `tick` [s] are shown at an even pace.
        """
        intents = [session.intents(frames) for session in sessions]
        states = [session.state for session in sessions]
        for session in sessions:
            session.under_way = frames
        loop = asyncio.get_running_loop()
        start = perf_counter()
        try:
            results = await loop.run_in_executor(self._executor, self._frames, states, intents)
            self.metrics.step_seconds.observe((perf_counter() - start) / frames)
            if tick is not None:
                await asyncio.sleep(self._pace.wait(loop.time() - tick))
        finally:
            for session in sessions:
                session.under_way = 0
        self.metrics.ticks.inc(frames)
        self.metrics.frames.inc(sum(len(of_session) for of_session in results))
        self.metrics.batch.observe(len(sessions))
        if not self._ownership.valid:
            return  # too late: another replica may be computing these frames, and nobody has seen them here
        for session, frame_results in zip(sessions, results, strict=True):
            self._take(session, frame_results)

    def _take(self, session: Session, results: Sequence[Result]) -> None:
        try:
            for result in results:
                if session.ended:
                    return
                if isinstance(result, Exception):
                    raise result
                session.advance(*result)
                self._ownership.advanced(session)
        except Exception as error:
            log.error("session ended by an error", session=session.name, exc_info=error)
            self.metrics.failures.inc()
            self._ownership.remove(session, f"internal error: {type(error).__name__}")

    def _following(self, tick: float, now: float) -> float:
        """Time of the next tick; a late ticker does not run after what it missed, session time stretches instead."""
        following = tick + self._interval
        if following > now:
            return following
        if self._any_realtime():
            self.metrics.overruns.inc()
        return now + self._interval

    def _any_realtime(self) -> bool:
        return any(stream.realtime for session in self._live for stream in session.streams)

    def sweep(self) -> None:
        """Reclaims sessions that nobody has used for their idle timeout."""
        for session in self._live.expired():
            self._ownership.remove(session, "expired")
        self.metrics.sessions.set(len(self._live))
        self.metrics.streams.set(sum(len(session.streams) for session in self._live))

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
