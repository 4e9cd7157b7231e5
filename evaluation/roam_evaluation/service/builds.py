"""A checkout of this repository, of today or of earlier, as programs to run and measure beside one another."""

import os
import resource
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil

from roam_evaluation.service.server_process import ServerProcess, ready

_STEP = """
import sys, time, torch
torch.set_num_threads(1)
try:
    from roam_motion.animator import Animator, Steer
except ModuleNotFoundError:
    from motion.animator import Animator, Steer
animator = Animator.load("weights/motion.safetensors").warmed()
count, frames = int(sys.argv[1]), int(sys.argv[2])
states = [animator.start((float(i), 0.0), 0.1 * i, i) for i in range(count)]
intents = [Steer((0.3, 1.0))] * count
taken = []
for _ in range(frames):
    start = time.process_time()
    states = [state for state, _ in animator.step(states, intents)]
    taken.append(time.process_time() - start)
print(sorted(taken)[len(taken) // 2])
"""


@dataclass(frozen=True)
class Ran:
    """One run of a program to its end."""

    wall: float  # [s]
    processor: float  # [s] user and system time, of its children too
    memory: float  # [MB] most that its largest process held
    output: str


@dataclass(frozen=True)
class Build:
    """A checkout; packages lie where they lay at its time."""

    root: Path

    @property
    def environment(self) -> dict[str, str]:
        """For its programs: its own packages before all others."""
        services, clients = self.root / "services", self.root / "clients" / "python"
        rooms = [path for path in sorted(services.iterdir()) if (path / f"roam_{path.name}").is_dir()]
        paths = [*(rooms or [services]), self.root / "evaluation" if rooms else self.root, clients]
        return os.environ | {"PYTHONPATH": os.pathsep.join(map(str, paths)), "OMP_NUM_THREADS": "1"}

    def module(self, name: str) -> str:
        """What `motion.app` and its like are called there."""
        return f"roam_{name}" if (self.root / "services" / "motion" / "roam_motion").is_dir() else name

    def run(self, arguments: Sequence[str]) -> Ran:
        """Python with these arguments, to its end. CalledProcessError when it fails."""
        process = subprocess.Popen(
            [sys.executable, *arguments], cwd=self.root, env=self.environment, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        start = psutil.Process(process.pid).create_time()
        assert process.stdout is not None
        output = process.stdout.read()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise subprocess.CalledProcessError(process.returncode, arguments, output)
        return Ran(time.time() - start, _processor(used), used.ru_maxrss / 1024, output)

    def command(self, *arguments: str) -> Ran:
        """`roam` with these arguments."""
        return self.run(["-m", "roam_command", *arguments])

    def step_seconds(self, sessions: int, frames: int) -> float:
        """Processor time of one batched step of so many walking characters: the median [s]."""
        return float(self.run(["-c", _STEP, str(sessions), str(frames)]).output)

    @contextmanager
    def server(self, name: str) -> Iterator[ServerProcess]:
        """Its `motion` or `goalpose` server on free ports, ready; killed when the block ends."""
        arguments = ["-m", self.module(f"{name}.app"), "--http-port", "0", "--grpc-port", "0", "--log-level", "error"]
        process = subprocess.Popen(
            [sys.executable, *arguments], cwd=self.root, env=self.environment, stdout=subprocess.PIPE, text=True
        )
        try:
            yield ready(process)
        finally:
            children = psutil.Process(process.pid).children(recursive=True)
            for one in (process, *children):
                one.kill()
            process.wait()


def shared_memory(server: ServerProcess) -> float:
    """Memory of all processes of a server [MB]; what they share counts once (PSS)."""
    own = psutil.Process(server.process.pid)
    return sum(float(one.memory_full_info().pss) for one in (own, *own.children(recursive=True))) / 1e6


def _processor(used: "resource.struct_rusage") -> float:
    return used.ru_utime + used.ru_stime
