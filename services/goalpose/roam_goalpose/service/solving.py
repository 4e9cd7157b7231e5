"""One running optimisation that any number of callers watch; it stops when the last of them leaves."""

import asyncio
import threading
from collections.abc import AsyncGenerator, Awaitable, Callable
from time import monotonic
from typing import Generic, TypeVar

T = TypeVar("T")
P = TypeVar("P")

_INTERVAL = 0.1  # [s] between two progress messages

Tell = Callable[[P], None]
Cancelled = Callable[[], bool]


class Solving(Generic[P, T]):
    """A job of the compute queue with its newest progress.

    `start(tell, cancelled)` begins the job: `tell(progress)` may be called from the compute thread, as often as it
    likes; `cancelled()` turns true when nobody watches any more.
    """

    def __init__(self, start: Callable[[Tell[P], Cancelled], Awaitable[T]]) -> None:
        self._loop = asyncio.get_running_loop()
        self._stop = threading.Event()
        self._watchers: set[asyncio.Event] = set()
        self._progress: tuple[int, P] | None = None  # a count, to tell new from seen
        self._last_told = float("-inf")
        self.task: asyncio.Task[T] = asyncio.ensure_future(self._run(start))
        self.task.add_done_callback(lambda _: self._wake())

    @property
    def abandoned(self) -> bool:
        """Whether it was stopped because nobody watched."""
        return self._stop.is_set()

    async def watch(self) -> AsyncGenerator[P]:
        """Progress, newest only, until the job ends; then `task.result()` has its outcome."""
        awake = asyncio.Event()
        self._watchers.add(awake)
        seen = 0
        try:
            while not self.task.done():
                await awake.wait()
                awake.clear()
                if self._progress is not None and self._progress[0] > seen:
                    seen, progress = self._progress
                    yield progress
        finally:
            self._watchers.discard(awake)
            if not self._watchers and not self.task.done():
                self._stop.set()
                self.task.cancel()

    async def _run(self, start: Callable[[Tell[P], Cancelled], Awaitable[T]]) -> T:
        return await start(self._tell, self._stop.is_set)

    def _tell(self, progress: P) -> None:
        """Called in the compute thread."""
        now = monotonic()
        if now - self._last_told >= _INTERVAL and not self._loop.is_closed():
            self._last_told = now
            self._loop.call_soon_threadsafe(self._take, progress)

    def _take(self, progress: P) -> None:
        count = self._progress[0] + 1 if self._progress else 1
        self._progress = (count, progress)
        self._wake()

    def _wake(self) -> None:
        for awake in self._watchers:
            awake.set()
