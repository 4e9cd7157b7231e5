"""Both services inside this process, on free loopback ports, in a thread with its own event loop."""

import asyncio
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from roam_client import RoamError

from roam_command.reports import UsageError

if TYPE_CHECKING:
    from roam_serving.server import Addresses
    from roam_serving.service import Service
    from roam_serving.settings import ServerSettings


def make_services(**addresses: Any) -> "tuple[list[Service], ServerSettings]":
    """Both services and the settings of the process that runs them; `addresses` are fields of ServerSettings.

    UsageError when the services are not installed.
    """
    try:
        from roam_goalpose.app import GoalPoseService
        from roam_goalpose.settings import GoalPoseSettings
        from roam_motion.app import MotionService
        from roam_motion.settings import MotionSettings
    except ModuleNotFoundError as error:
        raise UsageError(
            f"the services are not installed here ({error.name} is missing)",
            remedy="Use a running server with --server host:port, or install them: scripts/install in a checkout.",
        ) from error
    goalpose = GoalPoseSettings(**addresses)
    return [GoalPoseService(goalpose), MotionService(MotionSettings(**addresses, step_process=False))], goalpose


@contextmanager
def running_in_thread(services: "Sequence[Service]", settings: "ServerSettings") -> "Iterator[Addresses]":
    """Runs services in a thread until the block ends. RoamError when they cannot start."""
    started: Future[tuple[Addresses, asyncio.AbstractEventLoop, asyncio.Event]] = Future()
    thread = threading.Thread(target=_run, args=(services, settings, started), name="roam-services", daemon=True)
    thread.start()
    try:
        addresses, loop, stop = started.result()
    except (OSError, ValueError, RuntimeError) as error:
        raise RoamError(f"the services could not start: {error}") from error
    try:
        yield addresses
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join(timeout=15)


def _run(services: "Sequence[Service]", settings: "ServerSettings", started: "Future[Any]") -> None:
    from roam_serving.server import running

    async def main() -> None:
        stop = asyncio.Event()
        async with running(services, settings) as addresses:
            started.set_result((addresses, asyncio.get_running_loop(), stop))
            await stop.wait()

    try:
        asyncio.run(main())
    except BaseException as error:
        # The starting thread waits for an answer, whatever went wrong; after the start there is nobody left to tell.
        if started.done():
            raise
        started.set_exception(error)


@contextmanager
def embedded() -> Iterator[str]:
    """The gRPC address of both services."""
    # Whatever the environment asks of real servers, this one is private to the process.
    open_to_itself = {"tls_cert": "", "tls_key": "", "tls_client_ca": "", "api_keys": "", "requests_per_second": 0.0}
    services, settings = make_services(host="127.0.0.1", http_port=0, grpc_port=0, **open_to_itself)
    with running_in_thread(services, settings) as addresses:
        yield addresses.grpc
