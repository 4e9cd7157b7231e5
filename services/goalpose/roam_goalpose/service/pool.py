"""Synthesizers in processes of their own: goal poses use every core, and none of them holds up the server's loop."""

import multiprocessing
import signal
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext
from multiprocessing.synchronize import Event
from time import monotonic
from typing import Any

import torch

from roam_goalpose.objects import Shape
from roam_goalpose.references.pairs import ReferencePair
from roam_goalpose.solvers.progress import Cancelled, Listener, Progress
from roam_goalpose.synthesis import GoalPoseRequest, GoalPoseResult, RequestError, Synthesizer, SynthesizerSettings

_LOOK = 0.02  # [s] between two looks whether the caller has left
_TELL = 0.1  # [s] between two messages of progress
_START = 120.0  # [s] a cold start on a busy machine; normally two

Lane = tuple[Connection, Event]
Load = Callable[[SynthesizerSettings], Any]  # makes what has `synthesize`; a module's own function, so that it travels


class SynthesizerPool:
    """Several processes behind `Synthesizer.synthesize`; thread-safe, `lanes` callers at a time for each process.

    Callers in one process share their optimiser's steps. Further ones wait for a free lane. A process that dies fails
    the requests it worked on and is started anew for the next one.
    """

    def __init__(
        self,
        settings: SynthesizerSettings,
        *,
        processes: int,
        lanes: int = 1,
        torch_threads: int = 1,
        load: Load = Synthesizer.load,
    ) -> None:
        self.references: Mapping[str, ReferencePair] = {}
        self.field_name = ""
        self._workers = [_Worker(settings, lanes, torch_threads, load) for _ in range(processes)]
        self._freed = threading.Condition()
        try:
            for worker in self._workers:
                worker.launch()
            for worker in self._workers:
                self.references, self.field_name = worker.wait_ready()
        except BaseException:
            self.close()
            raise

    def synthesize(
        self,
        shape: Shape,
        request: GoalPoseRequest,
        *,
        progress: Listener | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> GoalPoseResult:
        """Like `Synthesizer.synthesize`; RuntimeError when the process breaks."""
        with self._freed:
            self._freed.wait_for(lambda: any(worker.free for worker in self._workers))
            worker = max(self._workers, key=lambda worker: len(worker.free))
            number = worker.free.pop(0)
        try:
            return worker.run(number, shape, request, progress, cancelled)
        finally:
            with self._freed:
                worker.free.append(number)
                self._freed.notify()

    def close(self) -> None:
        """Ends the processes at once."""
        for worker in self._workers:
            worker.kill()


class _Worker:
    """One process, started anew when it has died."""

    def __init__(self, settings: SynthesizerSettings, lanes: int, torch_threads: int, load: Load) -> None:
        self.free = list(range(lanes))  # the pool's account of what is idle
        self._lanes = lanes
        self._arguments = (settings, torch_threads, load)
        self._context = multiprocessing.get_context("spawn")  # a fork would copy torch's threads half
        self._process: _Process | None = None
        self._starting = threading.Lock()

    def launch(self) -> None:
        """Starts the process without waiting for it."""
        self._process = _Process(self._context, self._lanes, self._arguments)

    def wait_ready(self) -> tuple[Mapping[str, ReferencePair], str]:
        """Blocks until the process has loaded its networks: its references and its field's name.

        RuntimeError when it cannot.
        """
        assert self._process is not None
        return self._process.wait_ready()

    def run(
        self,
        number: int,
        shape: Shape,
        request: GoalPoseRequest,
        progress: Listener | None,
        cancelled: Callable[[], bool] | None,
    ) -> GoalPoseResult:
        """One synthesis in one of the process's lanes."""
        with self._starting:
            if self._process is None or not self._process.alive:
                self.launch()
                self.wait_ready()
            process = self._process
        assert process is not None
        return process.run(number, shape, request, progress, cancelled)

    def kill(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.kill()
            self._process = None


class _Process:
    """One life of a worker's process: a pipe and a flag to stop for every lane."""

    def __init__(self, context: SpawnContext, lanes: int, arguments: tuple[SynthesizerSettings, int, Load]) -> None:
        pipes = [context.Pipe() for _ in range(lanes)]
        self._lanes: list[Lane] = [(ours, context.Event()) for ours, _ in pipes]
        theirs = [(pipe, stop) for (_, pipe), (_, stop) in zip(pipes, self._lanes, strict=True)]
        self._ending = threading.Lock()
        self._process = context.Process(target=_serve, args=(theirs, *arguments), daemon=True)
        self._process.start()
        for pipe, _ in theirs:
            pipe.close()  # so that ours end with the process

    @property
    def alive(self) -> bool:
        """Whether it still runs."""
        return self._process.is_alive()

    def wait_ready(self) -> tuple[Mapping[str, ReferencePair], str]:
        """Its references and its field's name, once it has loaded them."""
        pipe, _ = self._lanes[0]
        if not pipe.poll(_START):
            self.kill()
            raise RuntimeError("a process for goal poses did not start in time")
        return self._answer(pipe)

    def run(
        self,
        number: int,
        shape: Shape,
        request: GoalPoseRequest,
        progress: Listener | None,
        cancelled: Callable[[], bool] | None,
    ) -> GoalPoseResult:
        """One synthesis in a lane that is free."""
        pipe, stop = self._lanes[number]
        stop.clear()
        pipe.send((shape, request))
        while True:
            while not pipe.poll(_LOOK):
                if cancelled is not None and cancelled():
                    stop.set()
            answer = self._answer(pipe)
            if isinstance(answer, GoalPoseResult):
                return answer
            if progress is not None:
                progress(answer)

    def kill(self) -> None:
        """Ends it."""
        self._process.kill()
        self._process.join()

    def _ended(self) -> int | None:
        """Waits for the end that a closed pipe announces. -> the exit code."""
        with self._ending:  # every lane comes here, but only one thread can ask the system for the code
            self._process.join(timeout=1)
            code = self._process.exitcode
            self.kill()
        return code

    def _answer(self, pipe: Connection) -> Any:
        """The next message of a lane, or the error that it is."""
        try:
            kind, value = pipe.recv()
        except (EOFError, OSError) as error:
            raise RuntimeError(f"the process that computes goal poses ended with code {self._ended()}") from error
        if kind == "cancelled":
            raise Cancelled
        if kind == "refused":
            raise RequestError(*value)
        if kind == "failed":
            raise RuntimeError(value)
        return value


def _serve(lanes: Sequence[Lane], settings: SynthesizerSettings, torch_threads: int, load: Load) -> None:
    """In the process: a thread for every lane, until the pipes close."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the server decides what ends when
    torch.set_num_threads(torch_threads)
    first, _ = lanes[0]
    try:
        synthesizer = load(settings)
    except Exception:
        first.send(("failed", traceback.format_exc()))
        return
    first.send(("ready", (synthesizer.references, synthesizer.field_name)))
    threads = [threading.Thread(target=_serve_lane, args=(synthesizer, *lane)) for lane in lanes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _serve_lane(synthesizer: Any, pipe: Connection, stop: Event) -> None:
    """One request after the other until the pipe closes."""
    while True:
        try:
            shape, request = pipe.recv()
        except EOFError:
            return
        pipe.send(_solve(synthesizer, shape, request, pipe, stop))


def _solve(
    synthesizer: Any, shape: Shape, request: GoalPoseRequest, pipe: Connection, stop: Event
) -> tuple[str, object]:
    told = float("-inf")

    def tell(progress: Progress) -> None:
        nonlocal told
        if monotonic() - told >= _TELL:
            told = monotonic()
            pipe.send(("progress", progress))

    try:
        return "done", synthesizer.synthesize(shape, request, progress=tell, cancelled=stop.is_set)
    except Cancelled:
        return "cancelled", None
    except RequestError as error:
        return "refused", (error.field, str(error))
    except Exception:
        return "failed", traceback.format_exc()
