"""The motion service over gRPC: a thin translation of MotionApplication."""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from contextlib import aclosing
from typing import Any

import grpc
from google.protobuf.timestamp_pb2 import Timestamp
from roam.v1 import motion_pb2, motion_pb2_grpc
from roam_serving.errors import ServiceError

from roam_motion.api.messages import session_message
from roam_motion.errors import OPEN_REQUIRED
from roam_motion.session.application import MotionApplication
from roam_motion.session.stream import FrameStream

# ruff: noqa: N802  # methods carry gRPC's names


class MotionServicer(motion_pb2_grpc.MotionServiceServicer):
    """roam.v1.MotionService; `application` is called per request because it exists only once models are loaded."""

    def __init__(self, application: Callable[[], MotionApplication]) -> None:
        self._application = application

    async def CreateSession(
        self, request: motion_pb2.CreateSessionRequest, context: Any
    ) -> motion_pb2.CreateSessionResponse:
        """Creates a session."""
        metadata = dict(context.invocation_metadata() or ())
        session = await self._application().create_session(request, metadata.get("x-roam-session", ""))
        return motion_pb2.CreateSessionResponse(session=session_message(session))

    async def GetSession(self, request: motion_pb2.GetSessionRequest, context: Any) -> motion_pb2.GetSessionResponse:
        """Reads a session."""
        session = await self._application().get_session(request.name)
        return motion_pb2.GetSessionResponse(session=session_message(session))

    async def ListSessions(
        self, request: motion_pb2.ListSessionsRequest, context: Any
    ) -> motion_pb2.ListSessionsResponse:
        """Lists sessions."""
        sessions, token = self._application().list_sessions(request.page_size, request.page_token)
        return motion_pb2.ListSessionsResponse(
            sessions=[session_message(session) for session in sessions], next_page_token=token
        )

    async def DeleteSession(
        self, request: motion_pb2.DeleteSessionRequest, context: Any
    ) -> motion_pb2.DeleteSessionResponse:
        """Ends a session."""
        await self._application().delete_session(request.name)
        return motion_pb2.DeleteSessionResponse()

    async def Control(self, request: motion_pb2.ControlRequest, context: Any) -> motion_pb2.ControlResponse:
        """Applies one control."""
        effective = await self._application().control(request.session, request.control)
        return motion_pb2.ControlResponse(effective_sequence=effective)

    async def Acknowledge(self, request: motion_pb2.AcknowledgeRequest, context: Any) -> motion_pb2.AcknowledgeResponse:
        """Acknowledges frames of WatchFrames."""
        self._application().acknowledge(request.session, request.stream, request.ack)
        return motion_pb2.AcknowledgeResponse()

    async def WatchFrames(
        self, request: motion_pb2.WatchFramesRequest, context: Any
    ) -> AsyncIterator[motion_pb2.WatchFramesResponse]:
        """Frames only."""
        application = self._application()
        async with application.stream(request.open) as stream:
            async for item in stream:
                yield motion_pb2.WatchFramesResponse(message=application.response(stream, item))

    async def Animate(
        self, requests: AsyncIterator[motion_pb2.AnimateRequest], context: Any
    ) -> AsyncIterator[motion_pb2.AnimateResponse]:
        """Controls up, frames down."""
        application = self._application()
        first = await anext(aiter(requests), None)
        async with (
            application.stream(opening_of(first)) as stream,
            aclosing(Duplex(application, stream).responses(requests)) as responses,
        ):
            async for response in responses:
                yield response


def opening_of(first: motion_pb2.AnimateRequest | None) -> motion_pb2.Open:
    """The Open that must come first; OPEN_REQUIRED otherwise."""
    if first is None or first.WhichOneof("message") != "open":
        raise ServiceError(OPEN_REQUIRED, "the first message was not Open")
    return first.open


class Duplex:
    """One bidirectional stream: reads requests in a task beside the frames that are sent."""

    def __init__(self, application: MotionApplication, stream: FrameStream) -> None:
        self._application = application
        self._stream = stream
        self._client_time: Timestamp | None = None
        self._failure: Exception | None = None

    async def responses(
        self, requests: AsyncIterator[motion_pb2.AnimateRequest]
    ) -> AsyncGenerator[motion_pb2.AnimateResponse]:
        """What goes down, until the session ends, the reader goes or a request is refused."""
        reading = asyncio.create_task(self._read(requests))
        try:
            async for item in self._stream:
                yield self._echoing(self._application.response(self._stream, item))
            if self._failure is not None:
                raise self._failure
        finally:
            reading.cancel()

    async def take(self, request: motion_pb2.AnimateRequest) -> None:
        """Acts on one request."""
        if request.HasField("client_time"):
            self._client_time = request.client_time
        kind = request.WhichOneof("message")
        if kind == "control":
            await self._application.control(self._stream.session.name, request.control)
        elif kind == "ack":
            self._stream.acknowledge(request.ack.sequence, request.ack.credit)
        elif kind == "open":
            raise ServiceError(OPEN_REQUIRED, "the stream is open already", field="open")

    def _echoing(self, response: motion_pb2.AnimateResponse) -> motion_pb2.AnimateResponse:
        """The response with the reader's clock, in a copy: frames are shared with other readers."""
        if self._client_time is None:
            return response
        echoing = motion_pb2.AnimateResponse(echo_client_time=self._client_time)
        echoing.MergeFrom(response)
        self._client_time = None
        return echoing

    async def _read(self, requests: AsyncIterator[motion_pb2.AnimateRequest]) -> None:
        try:
            async for request in requests:
                await self.take(request)
        except Exception as error:
            self._failure = error
            self._stream.finish()


SERVICE_NAME = motion_pb2.DESCRIPTOR.services_by_name["MotionService"].full_name


def add_to(server: grpc.aio.Server, application: Callable[[], MotionApplication]) -> tuple[str, ...]:
    """Adds the service to a server; returns its full name."""
    motion_pb2_grpc.add_MotionServiceServicer_to_server(MotionServicer(application), server)
    return (SERVICE_NAME,)
