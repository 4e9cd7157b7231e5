"""A service that only answers, waits and fails: what `serving` is tested with."""

import asyncio

import grpc
from fastapi import APIRouter, Request, WebSocket
from pydantic import BaseModel
from roam_serving.error_replies.closings import closing
from roam_serving.errors import COMMON, ServiceError, by_reason

KINDS = by_reason(COMMON)


class Body(BaseModel):
    number: int


def failure(reason: str) -> Exception:
    if reason == "BUG":
        return RuntimeError("a secret")
    return ServiceError(KINDS[reason], "what happened", field="some.field", retry_after=1.5)


class Echo:
    """Implements serving.service.Service."""

    name = "echo"
    skeletons = ()

    def __init__(self, *, loaded: asyncio.Event | None = None) -> None:
        self.models = {"echo": "sha256:00"}
        self.limits = {"max_words": 3}
        self.loaded = loaded
        self.released = asyncio.Event()
        self.started = asyncio.Event()
        self.closed = False

    async def load(self, metrics, readiness):
        if self.loaded is not None:
            await self.loaded.wait()

    def router(self):
        router = APIRouter()

        @router.post("/number")
        async def number(body: Body) -> int:
            return body.number

        @router.post("/size")
        async def size(request: Request) -> int:
            return len(await request.body())

        @router.get("/fail/{reason}")
        async def fail(reason: str) -> None:
            raise failure(reason)

        @router.get("/slow")
        async def slow() -> str:
            self.started.set()
            await self.released.wait()
            return "done"

        @router.websocket("/words")
        async def words(socket: WebSocket) -> None:
            await socket.accept()
            await socket.send_text("hello")
            await socket.close()

        @router.websocket("/fail/{reason}")
        async def fail_socket(socket: WebSocket, reason: str) -> None:
            await socket.accept()
            try:
                raise failure(reason)
            except ServiceError as error:
                await socket.close(*closing(error))

        return router

    def add_to(self, server):
        async def fail(request, context):
            raise failure(request.decode())

        async def fail_later(request, context):
            yield b"first"
            raise failure(request.decode())

        handlers = {
            "Fail": grpc.unary_unary_rpc_method_handler(fail),
            "FailLater": grpc.unary_stream_rpc_method_handler(fail_later),
        }
        server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler("echo.Echo", handlers),))
        return ("echo.Echo",)

    async def drain(self):
        self.released.set()

    async def close(self):
        self.closed = True
