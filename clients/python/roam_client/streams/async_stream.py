"""Frame streams for asyncio: `base_stream` with awaited reads."""

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from types import TracebackType
from typing import Any, Self

import grpc
import grpc.aio
from roam.v1 import motion_pb2

from roam_client.connection.transport import breaks_stream, resume_delays
from roam_client.errors import ConnectionFailedError, error_from_rpc
from roam_client.streams.base_stream import CALL_SECONDS, HEADER_SECONDS, BaseStream
from roam_client.streams.stream_state import StreamState
from roam_client.types.frames import Event, Frame

Connect = Callable[[bool], Awaitable[Any]]  # a stub of the motion service; True: on a connection of its own


class AsyncStream(BaseStream):
    """Iterates over frames and events of one session; a broken or silent connection is resumed where it left off.

    Opened by `Session.stream` (both directions in one call) or `Session.watch` (frames; controls travel beside it).
    `close` may be called from any task; a loop over the stream then ends.
    """

    def __init__(self, connect: Connect, state: StreamState, *, target: str, duplex: bool, resume_for: float) -> None:
        super().__init__(state, target=target, duplex=duplex, resume_for=resume_for)
        self._connecting = connect
        self._stub: Any = None
        self._silent = False
        self._messages: AsyncIterator[Any]

    async def __aenter__(self) -> Self:
        if not await self._resume(first=True):
            raise ConnectionFailedError("the stream was closed while it opened")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Leaves the stream; the session lives on."""
        self._left = True
        if self._call is not None:
            self._call.cancel()

    async def send(self, control: motion_pb2.ControlInput) -> None:
        """Sends a control, now or, if the connection is just broken, after it is back."""
        request = self._state.control(control)
        if self._duplex:
            await self._write(request)
        else:
            await self._send_beside(request)

    async def frames(self) -> AsyncIterator[Frame]:
        """Only the frames."""
        async for item in self:
            if isinstance(item, Frame):
                yield item

    async def __aiter__(self) -> AsyncIterator[Frame | Event]:
        while not self._state.ended and not self._left:
            # Acknowledged only now, when the caller has done with the last frame: that is what "slow reader" means.
            await self._flush()
            message = await self._next()
            if message is None:
                if self._left or not await self._resume():
                    return
                continue
            item = self._state.receive(message)
            if isinstance(item, Frame | Event):
                yield item

    async def _next(self) -> motion_pb2.AnimateResponse | None:
        """The next message; None when the connection has ended, was silent for too long, or the stream was left."""
        try:
            message = await self._read(self._state.patience)
        except grpc.RpcError as error:
            if not self._left:
                self._check(error)
            return None
        if self._silent:
            self._state.quiet += 1
        return message

    async def _read(self, patience: float | None) -> motion_pb2.AnimateResponse | None:
        try:
            message = await asyncio.wait_for(self._message(), patience)
        except TimeoutError:
            self._silent = True
            self._call.cancel()
            return None
        except asyncio.CancelledError:
            if self._left and not _cancelled():  # gRPC says so of a call that `close` has cancelled
                return None
            raise
        return message if message is None or self._duplex else message.message

    async def _message(self) -> Any:
        # Not read(): once the call has its status, that forgets the messages which nobody has taken yet.
        return await anext(self._messages, None)

    async def _connect(self) -> None:
        """Opens or continues the stream and waits for its header."""
        self._stub = await self._connecting(self._silent)
        self._silent = False
        opening = self._state.opening()
        if self._duplex:
            self._call = self._stub.Animate()
            await self._write(motion_pb2.AnimateRequest(open=opening))
        else:
            self._call = self._stub.WatchFrames(motion_pb2.WatchFramesRequest(open=opening))
        self._messages = aiter(self._call)
        if self._left:  # while it opened
            self._call.cancel()
        header = await self._read(HEADER_SECONDS)
        if header is None:
            raise self._headless()
        self._state.receive(header)

    async def _resume(self, *, first: bool = False) -> bool:
        """Opens the stream, again and again for a while; False when it was left meanwhile."""
        failure: Exception = self._given_up()
        ends = time.monotonic() + self._resume_for
        for delay in resume_delays(self._resume_for):
            await asyncio.sleep(delay)
            if self._left:
                return False
            try:
                await self._connect()
                return True
            except grpc.RpcError as error:
                if self._left:
                    return False
                self._check(error)
                failure = error_from_rpc(error, self._target) if first else failure
            except ConnectionFailedError as error:
                failure = error if first else failure
            if time.monotonic() > ends:
                break
        raise failure

    async def _flush(self) -> None:
        for request in self._state.take_outbox():
            if self._duplex:
                await self._write(request)
            elif request.HasField("control"):
                await self._send_beside(request)
            elif acknowledgement := self._state.acknowledgement(request):
                try:
                    await self._stub.Acknowledge(acknowledgement, timeout=CALL_SECONDS)
                except grpc.RpcError:  # the stream itself tells what is wrong
                    return

    async def _send_beside(self, request: motion_pb2.AnimateRequest) -> None:
        try:
            await self._stub.Control(self._control_request(request), timeout=CALL_SECONDS)
        except grpc.RpcError as error:
            if not breaks_stream(error):  # else it is sent again when the stream is back
                self._check(error)

    async def _write(self, request: motion_pb2.AnimateRequest) -> None:
        try:
            await self._call.write(request)
        except (grpc.RpcError, asyncio.InvalidStateError):
            # The call is over. Reading says why, and if it is resumed, unconfirmed controls are sent again.
            return


def _cancelled() -> bool:
    """Whether somebody has asked the running task to end."""
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0
