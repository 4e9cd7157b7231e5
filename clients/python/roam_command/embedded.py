"""Both services inside this process, on free loopback ports, in a thread with its own event loop."""

import asyncio
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from roam_client import RoamError

from roam_command.installation import services_module
from roam_command.reports import UsageError

if TYPE_CHECKING:
    from roam_serving.server import Addresses
    from roam_serving.service import Service
    from roam_serving.settings import ServerSettings


def make_services(wanted_by: str, **addresses: Any) -> "tuple[list[Service], ServerSettings]":
    """Both services and the settings of the process that runs them; `addresses` are fields of ServerSettings.

    UsageError when the services are not installed or a setting is wrong; `wanted_by` is the command, for that sentence.
    """
    goalpose = services_module("roam_goalpose.app", wanted_by=wanted_by)
    motion = services_module("roam_motion.app", wanted_by=wanted_by)
    from roam_serving.settings import SettingsError, read_settings

    try:
        posing = read_settings(goalpose.GoalPoseSettings, **addresses)
        moving = read_settings(motion.MotionSettings, **addresses, step_process=False)
    except SettingsError as error:
        raise UsageError(str(error), remedy="docs/how-to/operations.md lists the settings.") from error
    return [goalpose.GoalPoseService(posing), motion.MotionService(moving)], posing


@contextmanager
def running_in_thread(services: "Sequence[Service]", settings: "ServerSettings") -> "Iterator[Addresses]":
    """Runs services in a thread until the block ends.

    UsageError when a port is taken or a setting does not fit, RoamError when they cannot start for another reason.
    """
    from roam_serving.server import reason_of
    from roam_serving.settings import SettingsError

    started: Future[tuple[Addresses, asyncio.AbstractEventLoop, asyncio.Event]] = Future()
    thread = threading.Thread(target=_run, args=(services, settings, started), name="roam-services", daemon=True)
    thread.start()
    try:
        addresses, loop, stop = started.result()
    except (OSError, SettingsError) as error:
        raise UsageError(reason_of(error)) from error
    except (ValueError, RuntimeError) as error:
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
    services, settings = make_services("this command", host="127.0.0.1", http_port=0, grpc_port=0, **open_to_itself)
    with running_in_thread(services, settings) as addresses:
        yield addresses.grpc
