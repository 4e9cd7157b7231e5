"""The motion server as a process of its own, with the processor time that it takes."""

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import psutil


@dataclass(frozen=True)
class ServerProcess:
    """A running motion server."""

    process: subprocess.Popen[str]
    http: str
    grpc: str

    def processor_seconds(self) -> float:
        """User and system time so far [s], of its own process and those that it has started."""
        return float(sum(times.user + times.system for times in (one.cpu_times() for one in self._processes())))

    def memory(self) -> int:
        """Resident memory [bytes] of all its processes; what they share counts in each."""
        return sum(int(one.memory_info().rss) for one in self._processes())

    def _processes(self) -> list[psutil.Process]:
        own = psutil.Process(self.process.pid)
        return [own, *own.children(recursive=True)]


@contextmanager
def motion_servers(count: int = 1, options: Sequence[str] = ()) -> Iterator[list[ServerProcess]]:
    """Some servers on free ports, ready; killed when the block ends. RuntimeError when one does not start."""
    command = [sys.executable, "-m", "roam_motion.app", "--http-port", "0", "--grpc-port", "0", "--log-level", "error"]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    started = [
        subprocess.Popen([*command, *options], env=environment, stdout=subprocess.PIPE, text=True) for _ in range(count)
    ]
    try:
        yield [ready(process) for process in started]
    finally:
        for process in started:
            process.kill()
            process.wait()


def ready(process: "subprocess.Popen[str]") -> ServerProcess:
    """Waits until a server says where it answers. RuntimeError when it ends instead."""
    assert process.stdout is not None
    words = process.stdout.readline().split()
    if len(words) != 3 or words[0] != "ready":
        raise RuntimeError("the motion server did not start; its log says why")
    return ServerProcess(process, words[1].removeprefix("http="), words[2].removeprefix("grpc="))
