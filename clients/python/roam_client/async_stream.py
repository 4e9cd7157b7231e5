"""Frame streams for asyncio. The twin for ordinary code is `sync_stream`; keep the two alike."""

import asyncio
from collections.abc import AsyncIterator
from types import TracebackType
from typing import Any, Self

import grpc
import grpc.aio
from roam.v1 import motion_pb2, motion_pb2_grpc

from roam_client.errors import ConnectionFailedError, server_errors
from roam_client.frames import Event, Frame, Header
from roam_client.stream_state import StreamState
from roam_client.transport import breaks_stream, resume_delays


class AsyncStream:
    """Iterates over frames and events of one session; a broken connection is resumed where it left off.

    Opened by `Session.stream` (both directions in one call) or `Session.watch` (frames; controls travel beside it).
    """

    def __init__(
        self,
        stub: motion_pb2_grpc.MotionServiceStub,
        state: StreamState,
        *,
        target: str,
        duplex: bool,
        resume_for: float,
    ) -> None:
        self._stub = stub
        self._state = state
        self._target = target
        self._duplex = duplex
        self._resume_for = resume_for  # [s] of silence after which a broken stream is given up
        self._call: Any = None

    @property
    def header(self) -> Header:
        """The header in force: skeleton, frame rate. Known as soon as the stream is open."""
        assert self._state.header is not None, "open the stream first: async with session.stream() as stream"
        return self._state.header

    async def __aenter__(self) -> Self:
        with server_errors(self._target):
            await self._connect()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Leaves the stream; the session lives on."""
        if self._call is not None:
            self._call.cancel()

    async def send(self, control: motion_pb2.ControlInput) -> None:
        """Sends a control, now or, if the connection is just broken, after it is back."""
        request = self._state.control(control)
        if self._duplex:
            await self._write(request)
            return
        with server_errors(self._target):
            await self._stub.Control(motion_pb2.ControlRequest(session=self._state.session, control=request.control))

    async def frames(self) -> AsyncIterator[Frame]:
        """Only the frames."""
        async for item in self:
            if isinstance(item, Frame):
                yield item

    async def __aiter__(self) -> AsyncIterator[Frame | Event]:
        while not self._state.ended:
            # Acknowledged only now, when the caller has done with the last frame: that is what "slow reader" means.
            try:
                await self._flush()
                message = await self._read()
            except grpc.RpcError as error:
                if not breaks_stream(error):
                    with server_errors(self._target):
                        raise
                message = None
            if message is None:
                await self._resume()
                continue
            item = self._state.receive(message)
            if isinstance(item, Frame | Event):
                yield item

    async def _connect(self) -> None:
        """Opens or continues the stream and waits for its header."""
        opening = self._state.opening()
        if self._duplex:
            self._call = self._stub.Animate()
            await self._call.write(motion_pb2.AnimateRequest(open=opening))
        else:
            self._call = self._stub.WatchFrames(motion_pb2.WatchFramesRequest(open=opening))
        header = await self._read()
        if header is None:
            raise ConnectionFailedError(f"{self._target} closed the stream before its header")
        self._state.receive(header)

    async def _read(self) -> motion_pb2.AnimateResponse | None:
        message = await self._call.read()
        if message is grpc.aio.EOF:
            return None
        received: motion_pb2.AnimateResponse = message if self._duplex else message.message
        return received

    async def _flush(self) -> None:
        for request in self._state.take_outbox():
            if self._duplex:
                await self._write(request)
            elif request.HasField("control"):
                await self._stub.Control(
                    motion_pb2.ControlRequest(session=self._state.session, control=request.control)
                )
            elif acknowledgement := self._state.acknowledgement(request):
                await self._stub.Acknowledge(acknowledgement)

    async def _write(self, request: motion_pb2.AnimateRequest) -> None:
        try:
            await self._call.write(request)
        except (grpc.RpcError, asyncio.InvalidStateError):
            # The call is over. Reading says why, and if it is resumed, unconfirmed controls are sent again.
            return

    async def _resume(self) -> None:
        for delay in resume_delays(self._resume_for):
            await asyncio.sleep(delay)
            try:
                return await self._connect()
            except grpc.RpcError as error:
                if not breaks_stream(error):
                    with server_errors(self._target):
                        raise
            except ConnectionFailedError:
                continue
        raise ConnectionFailedError(
            f"the stream from {self._target} broke and could not be resumed in {self._resume_for:g} s"
        )
