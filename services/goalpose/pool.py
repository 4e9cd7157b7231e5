"""Synthesizers in processes of their own: goal poses use every core, and none of them holds up the server's loop."""

import multiprocessing
import queue
import signal
import traceback
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event
from time import monotonic
from typing import Any

import torch

from goalpose.objects import Shape
from goalpose.progress import Cancelled, Listener, Progress
from goalpose.references import ReferencePair
from goalpose.synthesis import GoalPoseRequest, GoalPoseResult, RequestError, Synthesizer, SynthesizerSettings

_LOOK = 0.02  # [s] between two looks whether the caller has left
_TELL = 0.1  # [s] between two messages of progress
_START = 120.0  # [s] a cold start on a busy machine; normally two

Load = Callable[[SynthesizerSettings], Any]  # makes what has `synthesize`; a module's own function, so that it travels


class SynthesizerPool:
    """Several processes behind `Synthesizer.synthesize`; thread-safe, as many callers at a time as there are processes.

    Further callers wait for an idle one. A process that dies fails the request it worked on and is started anew for
    the next one.
    """

    def __init__(
        self,
        settings: SynthesizerSettings,
        *,
        processes: int,
        torch_threads: int = 1,
        load: Load = Synthesizer.load,
    ) -> None:
        self.references: Mapping[str, ReferencePair] = {}
        self.field_name = ""
        self._workers = [_Worker(settings, torch_threads, load) for _ in range(processes)]
        self._idle: queue.SimpleQueue[_Worker] = queue.SimpleQueue()
        try:
            for worker in self._workers:
                worker.launch()
            for worker in self._workers:
                self.references, self.field_name = worker.wait_ready()
                self._idle.put(worker)
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
        worker = self._idle.get()
        try:
            return worker.run(shape, request, progress, cancelled)
        finally:
            self._idle.put(worker)

    def close(self) -> None:
        """Ends the processes at once."""
        for worker in self._workers:
            worker.kill()


class _Worker:
    """One process and the pipe to it."""

    def __init__(self, settings: SynthesizerSettings, torch_threads: int, load: Load) -> None:
        self._context = multiprocessing.get_context("spawn")  # a fork would copy torch's threads half
        self._arguments = (settings, torch_threads, load)
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection
        self._stop: Event

    def launch(self) -> None:
        """Starts the process without waiting for it."""
        self._stop = self._context.Event()
        self._pipe, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs, self._stop, *self._arguments), daemon=True)
        process.start()
        theirs.close()  # so that the pipe ends with the process
        self._process = process

    def wait_ready(self) -> tuple[Mapping[str, ReferencePair], str]:
        """Blocks until the process has loaded its networks: its references and its field's name.

        RuntimeError when it cannot.
        """
        if not self._pipe.poll(_START):
            self.kill()
            raise RuntimeError("a process for goal poses did not start in time")
        return self._answer()

    def run(
        self,
        shape: Shape,
        request: GoalPoseRequest,
        progress: Listener | None,
        cancelled: Callable[[], bool] | None,
    ) -> GoalPoseResult:
        """One synthesis in the process."""
        if self._process is None or not self._process.is_alive():
            self.launch()
            self.wait_ready()
        self._stop.clear()
        self._pipe.send((shape, request))
        while True:
            while not self._pipe.poll(_LOOK):
                if cancelled is not None and cancelled():
                    self._stop.set()
            answer = self._answer()
            if isinstance(answer, GoalPoseResult):
                return answer
            if progress is not None:
                progress(answer)

    def kill(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._pipe.close()
            self._process = None

    def _answer(self) -> Any:
        """The next message of the process, or the error that it is."""
        try:
            kind, value = self._pipe.recv()
        except (EOFError, OSError) as error:
            assert self._process is not None
            self._process.join(timeout=1)  # the pipe closes a moment before the process has ended
            code = self._process.exitcode
            self.kill()
            raise RuntimeError(f"the process that computes goal poses ended with code {code}") from error
        if kind == "cancelled":
            raise Cancelled
        if kind == "refused":
            raise RequestError(*value)
        if kind == "failed":
            raise RuntimeError(value)
        return value


def _serve(pipe: Connection, stop: Event, settings: SynthesizerSettings, torch_threads: int, load: Load) -> None:
    """In the process: one request after the other until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the server decides what ends when
    torch.set_num_threads(torch_threads)
    try:
        synthesizer = load(settings)
    except Exception:
        pipe.send(("failed", traceback.format_exc()))
        return
    pipe.send(("ready", (synthesizer.references, synthesizer.field_name)))
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
