"""Heavy work off the event loop, with a bound on how much may wait."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from time import monotonic
from typing import TypeVar

from prometheus_client import CollectorRegistry, Counter, Gauge

from roam_serving.errors import QUEUE_FULL, ServiceError

T = TypeVar("T")

_FIRST_GUESS = 5.0  # seconds a job takes, before any was measured
_SMOOTHING = 0.3  # weight of the newest job in the running mean


class ComputeQueue:
    """Threads that run jobs in order of arrival; refuses with QUEUE_FULL beyond `limit` jobs waiting or running."""

    def __init__(self, name: str, *, limit: int, registry: CollectorRegistry, threads: int = 1) -> None:
        self._executor = ThreadPoolExecutor(threads, thread_name_prefix=name)
        self._threads = threads
        self._limit = limit
        self._pending = 0
        self._mean_seconds = _FIRST_GUESS
        self._depth = Gauge(f"roam_{name}_queue_depth", "Jobs waiting or running.", registry=registry)
        self._refused = Counter(f"roam_{name}_queue_refused", "Jobs refused: queue full.", registry=registry)

    @property
    def pending(self) -> int:
        """Jobs waiting or running."""
        return self._pending

    async def run(self, job: Callable[[], T]) -> T:
        """The job's result. Cancelling the caller drops a waiting job; a running one must watch for it by itself."""
        self.check_room()
        future = self._executor.submit(self._timed, job)
        self._change(1)
        loop = asyncio.get_running_loop()
        future.add_done_callback(lambda _: _call_soon(loop, self._change, -1))
        return await asyncio.wrap_future(future)

    def check_room(self) -> None:
        """QUEUE_FULL, with the time to wait, when one more job would be refused."""
        if self._pending >= self._limit:
            self._refused.inc()
            wait = max(1.0, self._mean_seconds * self._pending / self._threads)
            raise ServiceError(QUEUE_FULL, f"{self._pending} jobs are waiting or running", retry_after=round(wait, 1))

    def close(self) -> None:
        """Drops waiting jobs; the running one ends by itself."""
        self._executor.shutdown(wait=False, cancel_futures=True)

    def _timed(self, job: Callable[[], T]) -> T:
        start = monotonic()
        try:
            return job()
        finally:
            self._mean_seconds += _SMOOTHING * (monotonic() - start - self._mean_seconds)

    def _change(self, by: int) -> None:
        self._pending += by
        self._depth.set(self._pending)


def _call_soon(loop: asyncio.AbstractEventLoop, callback: Callable[[int], None], value: int) -> None:
    """Calls back on the loop from any thread; a loop that is already closed needs no books kept."""
    if not loop.is_closed():
        loop.call_soon_threadsafe(callback, value)
