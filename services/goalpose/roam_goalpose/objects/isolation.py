"""`load_shape` for servers: in a child process that can be killed, so that no file can take the server down.

Readers stay warm: starting Python and its imports costs about a second, passing a file through an idle reader a few
milliseconds. A reader that breaks a limit is killed and replaced; the sender gets an `ObjectError`.
"""

from __future__ import annotations

import logging
import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from types import TracebackType
from typing import Any, Self

from roam_goalpose.objects.errors import ObjectError, out_of_memory
from roam_goalpose.objects.limits import Limits, check_bytes
from roam_goalpose.objects.placing.axes import check_up
from roam_goalpose.objects.placing.units import check_size, check_unit
from roam_goalpose.objects.readers.registry import added_modules, check_content, check_format
from roam_goalpose.objects.shape import Shape
from roam_goalpose.objects.wire import read_frame, unpack_shape, write_frame

_log = logging.getLogger(__name__)

_START_SECONDS = 120.0  # a cold start on a busy machine; normally one
# A reader needs no secrets of the server's environment.
_PASSED_ON = ("PATH", "LANG", "LC_ALL", "TMPDIR", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "PYTHONHASHSEED")


class IsolatedLoader:
    """A few warm reader processes behind `load`.

    Args:
        readers: how many files may be read at the same time; further calls wait for a free reader.
        limits: bounds on every file. `memory_bytes` bounds a whole reader process.

    Thread-safe. `load` blocks: call it from a thread (`asyncio.to_thread`). Use as a context manager, or call `close`.
    """

    def __init__(self, *, readers: int = 1, limits: Limits | None = None) -> None:
        self.limits = limits or Limits()
        self._idle: queue.SimpleQueue[_Reader] = queue.SimpleQueue()
        self._readers = [_Reader(self.limits) for _ in range(readers)]
        self._closed = False
        for reader in self._readers:
            self._idle.put(reader)

    def launch(self) -> None:
        """Start every reader without waiting for it."""
        for reader in self._readers:
            reader.launch()

    def warm(self) -> None:
        """Start every reader and wait until all have loaded their libraries."""
        self.launch()
        taken = [self._idle.get() for _ in self._readers]
        for reader in taken:
            reader.wait_ready()
            self._idle.put(reader)

    def load(
        self,
        data: bytes,
        format: str,
        *,
        unit: str | None = None,
        up: str | None = None,
        size: float | None = None,
        piece: str | None = None,
    ) -> Shape:
        """Like `loading.load_shape`, isolated.

        Raises:
            ObjectError: also OBJECT_TOO_COMPLEX when reading takes too much time or memory, OBJECT_READER_FAILED when a
                reader dies for no reason that we can name.
        """
        # What can be told without parsing does not take up a reader.
        format = check_format(format)
        unit = None if unit is None else check_unit(unit)
        up = None if up is None else check_up(up)
        size = None if size is None else check_size(size)
        check_bytes(len(data), self.limits)
        check_content(data, format)
        if self._closed:
            raise RuntimeError("the loader is closed")
        reader = self._idle.get()
        try:
            said = {"format": format, "unit": unit, "up": up, "size": size, "piece": piece}
            return reader.read(data, {**said, "limits": asdict(self.limits)})
        except ObjectError as error:
            if self._closed:
                raise _failed("the service is shutting down") from error
            raise
        except BaseException:
            reader.kill()  # half a frame may be on its way: the next file must not meet it
            raise
        finally:
            self._idle.put(reader)

    def close(self) -> None:
        """End all readers; a file being read at this moment fails with OBJECT_READER_FAILED."""
        self._closed = True
        for reader in self._readers:
            reader.kill()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class _Reader:
    """One child process, started when first needed and again after it was killed."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._modules: tuple[str, ...] = ()
        self._process: subprocess.Popen[bytes] | None = None
        self._ready = False

    def launch(self) -> None:
        """Start the process without waiting for it; again when a reader was registered since."""
        if self._process is not None and self._process.poll() is None and self._modules == added_modules():
            return
        self._modules = added_modules()
        self.kill()  # closes the pipes of one that died
        self._ready = False
        environment = {
            **{name: os.environ[name] for name in _PASSED_ON if name in os.environ},
            "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
            "OMP_NUM_THREADS": "1",  # BLAS would reserve address space for every thread
            "OPENBLAS_NUM_THREADS": "1",
            "PXR_WORK_THREAD_LIMIT": "1",
        }
        self._process = subprocess.Popen(
            [sys.executable, "-m", "roam_goalpose.objects.worker", str(self._limits.memory_bytes), *self._modules],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
        )

    def wait_ready(self) -> None:
        """Block until the process has loaded its libraries."""
        if self._ready:
            return
        frame = self._within(_START_SECONDS, lambda process: read_frame(_stream(process.stdout)))
        if frame is None:
            raise _failed("it did not start")
        self._ready = True

    def read(self, data: bytes, head: dict[str, Any]) -> Shape:
        """One file through the process."""
        self.launch()
        self.wait_ready()
        frame = self._within(self._limits.wall_seconds, lambda process: _exchange(process, data, head))
        if frame is None:
            raise self._explain()
        answer, parts = frame
        if answer["last"]:  # it is about to end: nobody shall send it another file meanwhile
            self.kill()
        if "fault" in answer:
            _log.error("reader failed: %s", answer["fault"])
            raise _failed("an error inside the reader")
        if "error" in answer:
            raise ObjectError.from_dict(answer["error"])
        return unpack_shape(answer["shape"], parts)

    def kill(self) -> None:
        """End the process at once and let go of its pipes."""
        process = self._process
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:  # unsent bytes for a process that is gone
                    continue

    def _within(self, seconds: float, work: Callable[[subprocess.Popen[bytes]], Any]) -> Any:
        """Run `work` while a timer stands by to kill the process: its end closes the pipes and so ends `work`."""
        process = self._process
        assert process is not None
        timer = threading.Timer(seconds, process.kill)
        timer.daemon = True
        timer.start()
        try:
            return work(process)
        except (OSError, ValueError):  # the pipe broke in the middle of a frame
            return None
        finally:
            timer.cancel()

    def _explain(self) -> ObjectError:
        """Why the pipe closed: the timer killed the process, or the kernel for its CPU time, or it broke.

        Its own faults it tells of; with code 1 it ends where a library gives up for want of memory (OpenBLAS exits).
        """
        process = self._process
        assert process is not None
        with suppress(subprocess.TimeoutExpired):  # one that ends by itself has a code of its own
            process.wait(1.0)
        self.kill()
        if -process.returncode in (signal.SIGKILL, signal.SIGXCPU):
            return ObjectError(
                "OBJECT_TOO_COMPLEX",
                field="content",
                message=f"Reading the file takes longer than {self._limits.cpu_seconds:g} s.",
                remedy="Simplify the mesh (in Blender: the Decimate modifier); 20,000 triangles are plenty.",
            )
        if process.returncode == 1:
            return out_of_memory()
        return _failed(f"it ended with code {process.returncode}")


def _exchange(
    process: subprocess.Popen[bytes], data: bytes, head: dict[str, Any]
) -> tuple[dict[str, Any], list[bytes]] | None:
    write_frame(_stream(process.stdin), head, [data])
    return read_frame(_stream(process.stdout))


def _stream(pipe: Any) -> Any:
    assert pipe is not None
    return pipe


def _failed(detail: str) -> ObjectError:
    return ObjectError(
        "OBJECT_READER_FAILED",
        field="content",
        message=f"The process that reads files stopped: {detail}.",
        remedy="Try again; if it happens again with this file, export it as GLB.",
    )
