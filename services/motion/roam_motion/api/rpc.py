"""The motion service over gRPC: a thin translation of MotionApplication."""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from contextlib import aclosing, asynccontextmanager
from typing import Any

import grpc
from google.protobuf.timestamp_pb2 import Timestamp
from roam.v1 import motion_pb2, motion_pb2_grpc, skeleton_pb2
from roam_serving.errors import ServiceError

from roam_motion.api import messages
from roam_motion.api.messages import session_message
from roam_motion.errors import OPEN_REQUIRED
from roam_motion.session.application import MotionApplication
from roam_motion.session.stream import FrameStream, Item

# ruff: noqa: N802  # methods carry gRPC's names


class MotionServicer(motion_pb2_grpc.MotionServiceServicer):
    """roam.v1.MotionService; `application` is called per request because it exists only once models are loaded.

    `skeleton` is what stream headers tell of the server's.
    """

    def __init__(self, application: Callable[[], MotionApplication], skeleton: skeleton_pb2.Skeleton) -> None:
        self._application, self._skeleton = application, skeleton

    async def CreateSession(
        self, request: motion_pb2.CreateSessionRequest, context: Any
    ) -> motion_pb2.CreateSessionResponse:
        """Creates a session."""
        metadata = dict(context.invocation_metadata() or ())
        application = self._application()
        asked = messages.session_request(request, application.skeleton)
        session = await application.create_session(asked, metadata.get("x-roam-session", ""))
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
        application = self._application()
        control = messages.control_request(request.control, application.skeleton)
        effective = await application.control(request.session, control)
        return motion_pb2.ControlResponse(effective_sequence=effective)

    async def Acknowledge(self, request: motion_pb2.AcknowledgeRequest, context: Any) -> motion_pb2.AcknowledgeResponse:
        """Acknowledges frames of WatchFrames."""
        self._application().acknowledge(request.session, request.stream, request.ack.sequence, request.ack.credit)
        return motion_pb2.AcknowledgeResponse()

    async def WatchFrames(
        self, request: motion_pb2.WatchFramesRequest, context: Any
    ) -> AsyncIterator[motion_pb2.WatchFramesResponse]:
        """Frames only."""
        async with opened(self._application(), request.open, self._skeleton) as (stream, respond):
            async for item in stream:
                yield motion_pb2.WatchFramesResponse(message=respond(item))

    async def Animate(
        self, requests: AsyncIterator[motion_pb2.AnimateRequest], context: Any
    ) -> AsyncIterator[motion_pb2.AnimateResponse]:
        """Controls up, frames down."""
        application = self._application()
        opening = opening_of(await anext(aiter(requests), None))
        async with (
            opened(application, opening, self._skeleton) as (stream, respond),
            aclosing(Duplex(application, stream, respond).responses(requests)) as responses,
        ):
            async for response in responses:
                yield response


Respond = Callable[[Item], motion_pb2.AnimateResponse]


@asynccontextmanager
async def opened(
    application: MotionApplication, opening: motion_pb2.Open, skeleton: skeleton_pb2.Skeleton
) -> AsyncIterator[tuple[FrameStream, Respond]]:
    """A stream for the time of the `async with` block, and what makes its items messages."""
    told = messages.known_skeleton(skeleton, opening.known_skeleton_id)
    frames = messages.Following(messages.frame_format(opening))
    async with application.stream(opening.session, messages.stream_options(opening)) as stream:
        yield stream, lambda item: messages.response(stream, item, frames, told)


def opening_of(first: motion_pb2.AnimateRequest | None) -> motion_pb2.Open:
    """The Open that must come first; OPEN_REQUIRED otherwise."""
    if first is None or first.WhichOneof("message") != "open":
        raise ServiceError(OPEN_REQUIRED, "the first message was not Open")
    return first.open


class Duplex:
    """One bidirectional stream: reads requests in a task beside the frames that are sent."""

    def __init__(self, application: MotionApplication, stream: FrameStream, respond: Respond) -> None:
        self._application, self._stream, self._respond = application, stream, respond
        self._client_time: Timestamp | None = None
        self._failure: Exception | None = None

    async def responses(
        self, requests: AsyncIterator[motion_pb2.AnimateRequest]
    ) -> AsyncGenerator[motion_pb2.AnimateResponse]:
        """What goes down, until the session ends, the reader goes or a request is refused."""
        reading = asyncio.create_task(self._read(requests))
        try:
            async for item in self._stream:
                yield self._echoing(self._respond(item))
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
            control = messages.control_request(request.control, self._application.skeleton)
            await self._application.control(self._stream.session.name, control)
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


def add_to(
    server: grpc.aio.Server, application: Callable[[], MotionApplication], skeleton: skeleton_pb2.Skeleton
) -> tuple[str, ...]:
    """Adds the service to a server; returns its full name."""
    motion_pb2_grpc.add_MotionServiceServicer_to_server(MotionServicer(application, skeleton), server)
    return (SERVICE_NAME,)
