"""One event loop for uvicorn and grpc.aio: several services, two ports, one readiness, one shutdown."""

import asyncio
import signal
import socket
import sys
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from importlib.metadata import version as package_version
from typing import Any, NoReturn

import grpc
import uvicorn
from fastapi import FastAPI
from roam.v1 import server_pb2, server_pb2_grpc, skeleton_pb2, skeleton_pb2_grpc

from roam_serving.access import Access
from roam_serving.collector import spare_collector
from roam_serving.endpoints.describe import ServerServicer, describe_router
from roam_serving.endpoints.skeletons import SkeletonCatalogue, SkeletonServicer, skeletons_router
from roam_serving.http import create_http_app
from roam_serving.monitoring.logs import configure_logs, get_log
from roam_serving.monitoring.metrics import Metrics
from roam_serving.monitoring.readiness import Readiness
from roam_serving.monitoring.tracing import Tracing
from roam_serving.rpc.channel import SERVER_OPTIONS
from roam_serving.rpc.health import add_health, add_reflection
from roam_serving.rpc.interceptor import RequestInterceptor
from roam_serving.service import Service
from roam_serving.settings import MIB, ServerSettings, SettingsError, read_settings
from roam_serving.transport import transport_security

log = get_log("serving.server")

VERSION = package_version("roam-services")


@dataclass(frozen=True)
class Addresses:
    """Where a running server listens."""

    http: str  # "http://127.0.0.1:8080", https with TLS
    grpc: str  # "127.0.0.1:50051"


class _Uvicorn(uvicorn.Server):
    """uvicorn without its own signal handlers: this module owns the shutdown."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def _bind(settings: ServerSettings) -> socket.socket:
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((settings.host, settings.http_port))
    except OSError as error:
        listener.close()
        where = f"{settings.host}:{settings.http_port}"
        raise OSError(error.errno, f"cannot listen on {where} ({error.strerror}); choose another HTTP port") from error
    listener.setblocking(False)
    return listener


def _host(host: str) -> str:
    return f"[{host}]" if ":" in host else host


class Server:
    """Ports, health and life cycle around some services; made by `running`."""

    def __init__(self, services: Sequence[Service], settings: ServerSettings) -> None:
        self.services = services
        self.settings = settings
        self._tls = transport_security(settings)
        self._access = Access.of(settings)
        self._tracing = Tracing(settings, "-".join(service.name for service in services))
        self.readiness = Readiness()
        self.metrics = Metrics()
        self._skeletons = SkeletonCatalogue([item for service in services for item in service.skeletons])
        self._grpc = grpc.aio.server(
            interceptors=[RequestInterceptor(self.metrics, self._access, self._tracing)],
            options=SERVER_OPTIONS,
        )
        self._uvicorn: _Uvicorn
        self._http_task: asyncio.Task[None]
        self.addresses: Addresses

    async def open(self) -> None:
        """Opens both ports; /livez answers from here on, /readyz says that models are loading."""
        self.readiness.block("models", "loading")
        listener = _bind(self.settings)
        try:
            grpc_port = self._open_grpc()
        except OSError:
            listener.close()
            raise
        await self._grpc.start()
        self._uvicorn = _Uvicorn(self._uvicorn_config())
        self._http_task = asyncio.create_task(self._uvicorn.serve(sockets=[listener]))
        host = _host(self.settings.host)
        scheme = "https" if self._tls else "http"
        self.addresses = Addresses(f"{scheme}://{host}:{listener.getsockname()[1]}", f"{host}:{grpc_port}")
        while not self._uvicorn.started:
            if self._http_task.done():
                self._http_task.result()
                raise RuntimeError("the HTTP server ended while starting")
            await asyncio.sleep(0.005)

    async def load(self) -> None:
        """Loads every service's models; the server is ready afterwards."""
        for service in self.services:
            await service.load(self.metrics, self.readiness)
        self.readiness.clear("models")
        log.info("ready", http=self.addresses.http, grpc=self.addresses.grpc)

    async def close(self, grace: float) -> None:
        """Readiness off, streams told, running requests finished within `grace` seconds, ports closed."""
        self.readiness.block("server", "draining")
        await asyncio.gather(*(service.drain() for service in self.services))
        self._uvicorn.should_exit = True
        _, pending = await asyncio.wait(
            [asyncio.ensure_future(self._grpc.stop(grace)), self._http_task], timeout=grace + 1
        )
        if pending:
            self._uvicorn.force_exit = True
            await asyncio.wait(pending, timeout=1)
        for service in self.services:
            await service.close()
        await asyncio.to_thread(self._tracing.close)
        log.info("closed")

    def _open_grpc(self) -> int:
        names = [
            server_pb2.DESCRIPTOR.services_by_name["ServerService"].full_name,
            skeleton_pb2.DESCRIPTOR.services_by_name["SkeletonService"].full_name,
        ]
        for service in self.services:
            names += service.add_to(self._grpc)
        server_pb2_grpc.add_ServerServiceServicer_to_server(ServerServicer(self.services, VERSION), self._grpc)
        skeleton_pb2_grpc.add_SkeletonServiceServicer_to_server(SkeletonServicer(self._skeletons), self._grpc)
        add_health(self._grpc, names, self.readiness)
        add_reflection(self._grpc, names)
        where = f"{_host(self.settings.host)}:{self.settings.grpc_port}"
        try:
            if self._tls is not None:
                return int(self._grpc.add_secure_port(where, self._tls.grpc_credentials()))
            return int(self._grpc.add_insecure_port(where))
        except RuntimeError as error:
            raise OSError(f"cannot listen on {where}; choose another gRPC port") from error

    def http_application(self) -> FastAPI:
        """Everything that answers over HTTP."""
        return create_http_app(
            title=f"ROAM {' and '.join(service.name for service in self.services)}",
            version=VERSION,
            routers=[
                *(service.router() for service in self.services),
                skeletons_router(self._skeletons),
                describe_router(self.services, VERSION),
            ],
            readiness=self.readiness,
            metrics=self.metrics,
            settings=self.settings,
            access=self._access,
            tracing=self._tracing,
        )

    def _uvicorn_config(self) -> uvicorn.Config:
        return uvicorn.Config(
            self.http_application(),
            log_config=None,
            access_log=False,
            lifespan="off",
            ws="websockets-sansio",
            ws_max_size=MIB,  # controls are small; uploads do not come this way
            ws_per_message_deflate=False,  # packed floats do not shrink
            timeout_graceful_shutdown=max(1, round(self.settings.drain_seconds)),
            **(self._tls.uvicorn_options() if self._tls else {}),
        )


@asynccontextmanager
async def running(services: Sequence[Service], settings: ServerSettings) -> AsyncIterator[Addresses]:
    """Runs the services inside this event loop; the addresses come when everything is ready.

    Raises OSError when a port is taken, SettingsError when those of TLS or keys do not fit, and whatever a service's
    `load` raises.
    """
    server = Server(services, settings)
    await server.open()
    try:
        await server.load()
        yield server.addresses
    finally:
        await server.close(grace=min(1.0, settings.drain_seconds))


async def _serve(services: Sequence[Service], settings: ServerSettings) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    server = Server(services, settings)
    await server.open()
    grace = settings.drain_seconds
    try:
        loading = asyncio.create_task(server.load())
        stopping = asyncio.create_task(stop.wait())
        await asyncio.wait([loading, stopping], return_when=asyncio.FIRST_COMPLETED)
        if stop.is_set():
            loading.cancel()
            return
        loading.result()
        spare_collector()
        print(f"ready http={server.addresses.http} grpc={server.addresses.grpc}", flush=True)
        await stopping
        log.info("draining", grace=grace)
        for number in (signal.SIGTERM, signal.SIGINT):  # a second signal ends the process at once
            loop.remove_signal_handler(number)
    finally:
        await server.close(grace)


def serve(services: Sequence[Service], settings: ServerSettings) -> None:
    """Runs the services as this process until SIGTERM or Ctrl-C; prints one line "ready http=… grpc=…" on stdout."""
    configure_logs(settings)
    try:
        asyncio.run(_serve(services, settings))
    except (OSError, SettingsError) as error:
        end_with_sentence(error)


def end_with_sentence(error: OSError | SettingsError) -> NoReturn:
    """Ends the process with exit code 2: whoever started it must change a setting."""
    print(f"error: {reason_of(error)}", file=sys.stderr)
    sys.exit(2)


def reason_of(error: OSError | SettingsError) -> str:
    """Why a server cannot start, without the number of the operating system's error."""
    if not isinstance(error, OSError) or error.strerror is None:
        return str(error)
    return f"{error.strerror}: {error.filename}" if error.filename else error.strerror


def main(kind: type[ServerSettings], make: Callable[[Any], Service], *, program: str) -> None:
    """A server as a program: settings from the arguments and the environment, one sentence when they are wrong."""
    try:
        settings = read_settings(kind, _cli_parse_args=True, _cli_prog_name=program)
    except SettingsError as error:
        end_with_sentence(error)
    serve([make(settings)], settings)
