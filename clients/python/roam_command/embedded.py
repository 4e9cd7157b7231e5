"""The services of one command, on free loopback ports: in a thread with an event loop, motion in a process beside."""

import asyncio
import gc
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from roam_client import RoamError

from roam_command.installation import services_module
from roam_command.motion_process import PRIVATE, MotionProcess, spare_processor
from roam_command.reports import UsageError

if TYPE_CHECKING:
    from roam_goalpose.objects.isolation import IsolatedLoader
    from roam_serving.server import Addresses
    from roam_serving.service import Service
    from roam_serving.settings import ServerSettings


def make_services(
    wanted_by: str, *, motion: bool = True, loader: "IsolatedLoader | None" = None, **addresses: Any
) -> "tuple[list[Service], ServerSettings]":
    """The services and the settings of the process that runs them; `addresses` are fields of ServerSettings.

    UsageError when the services are not installed or a setting is wrong; `wanted_by` is the command, for that sentence.
    """
    goalpose = services_module("roam_goalpose.app", wanted_by=wanted_by)
    from roam_serving.settings import SettingsError, read_settings

    try:
        posing = read_settings(goalpose.GoalPoseSettings, **addresses)
        services: list[Service] = [goalpose.GoalPoseService(posing, loader)]
        if motion:
            moving = services_module("roam_motion.app", wanted_by=wanted_by)
            settings = read_settings(moving.MotionSettings, **addresses, step_process=False)
            services.append(moving.MotionService(settings))
    except SettingsError as error:
        raise UsageError(str(error), remedy="docs/how-to/operations.md lists the settings.") from error
    return services, posing


@contextmanager
def running_in_thread(
    services: "Sequence[Service]", settings: "ServerSettings", *, http: bool = True
) -> "Iterator[Addresses]":
    """Runs services in a thread until the block ends, with or without an HTTP port.

    UsageError when a port is taken or a setting does not fit, RoamError when they cannot start for another reason.
    """
    from roam_serving.server import reason_of
    from roam_serving.settings import SettingsError

    started: Future[tuple[Addresses, asyncio.AbstractEventLoop, asyncio.Event]] = Future()
    thread = threading.Thread(target=_run, args=(services, settings, started, http), name="roam-services", daemon=True)
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


def _run(services: "Sequence[Service]", settings: "ServerSettings", started: "Future[Any]", http: bool) -> None:
    from roam_serving.server import running

    async def main() -> None:
        stop = asyncio.Event()
        async with running(services, settings, http=http) as addresses:
            started.set_result((addresses, asyncio.get_running_loop(), stop))
            await stop.wait()

    try:
        asyncio.run(main())
    except BaseException as error:
        # The starting thread waits for an answer, whatever went wrong; after the start there is nobody left to tell.
        if started.done():
            raise
        started.set_exception(error)


@dataclass(frozen=True)
class Started:
    """Where the services of one command answer gRPC."""

    goalpose: str
    motion: Callable[[], str]  # once it is there; RoamError when it cannot start


@contextmanager
def embedded(*, motion: bool = True) -> Iterator[Started]:
    """Both services, or goal poses alone, until the block ends; motion beside this process where that is quicker."""
    with ExitStack() as stack:
        loader = stack.enter_context(_launched_loader())
        beside = motion and spare_processor()
        process = stack.enter_context(MotionProcess()) if beside else None
        gc.disable()  # a tenth of the time that torch takes to import goes to looking for garbage that is none
        try:
            services, settings = make_services("this command", motion=motion and not beside, loader=loader, **PRIVATE)
        finally:
            gc.enable()
        here = stack.enter_context(running_in_thread(services, settings, http=False))
        yield Started(here.grpc, (lambda: process.address) if process is not None else (lambda: here.grpc))


def _launched_loader() -> "IsolatedLoader":
    """What reads the object, starting while this process still imports what solves."""
    loader: IsolatedLoader = services_module(
        "roam_goalpose.objects.isolation", wanted_by="this command"
    ).IsolatedLoader()
    loader.launch()
    return loader
