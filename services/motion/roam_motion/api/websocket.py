"""The motion service over WebSocket: the protobuf bytes of Animate, one message per binary frame.

For clients without HTTP/2: browsers, Godot, Unity WebGL. A refused stream is closed with code 4000 + HTTP status and
the reason of the error table.
"""

from collections.abc import AsyncIterator, Callable
from contextlib import aclosing

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from google.protobuf.message import DecodeError
from roam.v1 import motion_pb2, skeleton_pb2
from roam_serving.error_replies.closings import closing
from roam_serving.errors import INTERNAL, ServiceError
from roam_serving.monitoring.logs import get_log

from roam_motion.api.rpc import Duplex, opened, opening_of
from roam_motion.errors import MESSAGE_MALFORMED
from roam_motion.session.application import MotionApplication

log = get_log("roam_motion.api.websocket")

_DONE = 1000


def websocket_router(application: Callable[[], MotionApplication], skeleton: skeleton_pb2.Skeleton) -> APIRouter:
    """GET /v1/sessions/{id}/stream, upgraded; `skeleton` as stream headers tell it."""
    router = APIRouter()

    @router.websocket("/v1/sessions/{session}/stream")
    async def stream(socket: WebSocket, session: str) -> None:
        await socket.accept()
        try:
            await _animate(socket, application(), f"sessions/{session}", skeleton)
            await socket.close(_DONE)
        except WebSocketDisconnect:
            pass
        except ServiceError as error:
            await _refuse(socket, error)
        except Exception as error:
            log.error("stream failed", exc_info=error)
            await _refuse(socket, ServiceError(INTERNAL))

    return router


async def _refuse(socket: WebSocket, error: ServiceError) -> None:
    await socket.close(*closing(error))


async def _animate(
    socket: WebSocket, application: MotionApplication, session: str, skeleton: skeleton_pb2.Skeleton
) -> None:
    requests = _requests(socket)
    opening = opening_of(await anext(requests))
    opening.session = opening.session or session
    async with (
        opened(application, opening, skeleton) as (stream, respond),
        aclosing(Duplex(application, stream, respond).responses(requests)) as responses,
    ):
        async for response in responses:
            await socket.send_bytes(response.SerializeToString())


async def _requests(socket: WebSocket) -> AsyncIterator[motion_pb2.AnimateRequest]:
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code") or _DONE)
        data = message.get("bytes")
        if data is None:
            raise ServiceError(MESSAGE_MALFORMED, "a text message came; the stream is binary")
        try:
            yield motion_pb2.AnimateRequest.FromString(data)
        except DecodeError as error:
            raise ServiceError(MESSAGE_MALFORMED, str(error)) from error
