"""The motion service of one command, in a process beside it: it starts while the goal pose is solved.

`python -m roam_command.motion_process` prints its gRPC address, and ends when its standard input closes: with the
command that started it, however that ends.
"""

import asyncio
import gc
import os
import signal
import subprocess
import sys
from functools import cached_property
from typing import Any

from roam_client import RoamError

# Whatever the environment asks of real servers, those of one command are private to it.
PRIVATE: dict[str, Any] = {
    "host": "127.0.0.1",
    "http_port": 0,
    "grpc_port": 0,
    "tls_cert": "",
    "tls_key": "",
    "tls_client_ca": "",
    "api_keys": "",
    "requests_per_second": 0.0,
}


def spare_processor() -> bool:
    """Whether a processor is idle: without one a second process only costs, torch is imported twice."""
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    busy = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    return processors - busy >= 1.0 and processors > 1


class MotionProcess:
    """Starts it without waiting; use as a context manager, or call `close`."""

    def __init__(self) -> None:
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        command = [sys.executable, "-m", "roam_command.motion_process"]
        self._process = subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    @cached_property
    def address(self) -> str:
        """Blocks until it answers. RoamError when it cannot start."""
        assert self._process.stdout is not None
        address = self._process.stdout.readline().strip()
        if not address:
            raise RoamError("the motion service could not start; what it says is above")
        return address

    @property
    def ended(self) -> bool:
        """Whether it has."""
        return self._process.poll() is not None

    def close(self) -> None:
        """Lets it end."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        try:
            self._process.wait(15)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> "MotionProcess":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def main() -> None:
    """In the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the command too, which says when this ends
    gc.disable()  # importing makes no garbage
    from roam_motion.app import MotionService
    from roam_motion.settings import MotionSettings
    from roam_serving.server import reason_of
    from roam_serving.settings import SettingsError, read_settings

    gc.enable()
    try:
        settings = read_settings(MotionSettings, **PRIVATE, step_process=False)
        asyncio.run(_serve(MotionService(settings), settings))
    except (OSError, SettingsError) as error:  # the command says that it could not start, this why
        sys.exit(f"error: {reason_of(error)}")


async def _serve(service: Any, settings: Any) -> None:
    from roam_serving.collector import spare_collector
    from roam_serving.server import running

    async with running([service], settings, http=False) as addresses:
        spare_collector()
        print(addresses.grpc, flush=True)
        await asyncio.to_thread(sys.stdin.read)


if __name__ == "__main__":
    main()
