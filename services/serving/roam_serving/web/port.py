"""The HTTP port of a server: uvicorn inside the server's own event loop."""

import asyncio
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import uvicorn
from fastapi import FastAPI

from roam_serving.settings import MIB, ServerSettings
from roam_serving.transport import Tls


class _Uvicorn(uvicorn.Server):
    """uvicorn without its own signal handlers: `roam_serving.server` owns the shutdown."""

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


class HttpPort:
    """A port that answers as an application does; OSError when it cannot be had."""

    def __init__(self, settings: ServerSettings, tls: Tls | None) -> None:
        self._settings, self._tls = settings, tls
        self._listener = _bind(settings)
        self._uvicorn: _Uvicorn
        self.task: asyncio.Task[None]  # until the port is closed

    @property
    def number(self) -> int:
        """Which port."""
        return int(self._listener.getsockname()[1])

    def release(self) -> None:
        """Gives the port back before it was opened."""
        self._listener.close()

    async def open(self, application: FastAPI) -> None:
        """Answers from here on."""
        self._uvicorn = _Uvicorn(self._configured(application))
        self.task = asyncio.create_task(self._uvicorn.serve(sockets=[self._listener]))
        while not self._uvicorn.started:
            if self.task.done():
                self.task.result()
                raise RuntimeError("the HTTP server ended while starting")
            await asyncio.sleep(0.005)

    def stop(self) -> None:
        """Takes no more requests; those that run may finish."""
        self._uvicorn.should_exit = True

    def abandon(self) -> None:
        """Waits for no request any more."""
        self._uvicorn.force_exit = True

    def _configured(self, application: FastAPI) -> uvicorn.Config:
        return uvicorn.Config(
            application,
            log_config=None,
            access_log=False,
            lifespan="off",
            ws="websockets-sansio",
            ws_max_size=MIB,  # controls are small; uploads do not come this way
            ws_per_message_deflate=False,  # packed floats do not shrink
            timeout_graceful_shutdown=max(1, round(self._settings.drain_seconds)),
            **(self._tls.uvicorn_options() if self._tls else {}),
        )
