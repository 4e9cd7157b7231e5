"""Frame streams for ordinary code. The asyncio twin is `async_stream`; keep the two alike."""

import queue
import time
from collections.abc import Iterator
from types import TracebackType
from typing import Any, Self

import grpc
from roam.v1 import motion_pb2, motion_pb2_grpc

from roam_client.errors import ConnectionFailedError, server_errors
from roam_client.frames import Event, Frame, Header
from roam_client.stream_state import StreamState
from roam_client.transport import breaks_stream, resume_delays

Requests = queue.SimpleQueue[motion_pb2.AnimateRequest | None]


class Stream:
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
        self._requests: Requests = queue.SimpleQueue()
        self._call: Any = None

    @property
    def header(self) -> Header:
        """The header in force: skeleton, frame rate. Known as soon as the stream is open."""
        assert self._state.header is not None, "open the stream first: with session.stream() as stream"
        return self._state.header

    def __enter__(self) -> Self:
        with server_errors(self._target):
            self._connect()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leaves the stream; the session lives on."""
        self._requests.put(None)
        if self._call is not None:
            self._call.cancel()

    def send(self, control: motion_pb2.ControlInput) -> None:
        """Sends a control, now or, if the connection is just broken, after it is back."""
        request = self._state.control(control)
        if self._duplex:
            self._requests.put(request)
            return
        with server_errors(self._target):
            self._stub.Control(motion_pb2.ControlRequest(session=self._state.session, control=request.control))

    def frames(self) -> Iterator[Frame]:
        """Only the frames."""
        return (item for item in self if isinstance(item, Frame))

    def __iter__(self) -> Iterator[Frame | Event]:
        while not self._state.ended:
            # Acknowledged only now, when the caller has done with the last frame: that is what "slow reader" means.
            self._flush()
            try:
                message = self._read()
            except grpc.RpcError as error:
                if not breaks_stream(error):
                    with server_errors(self._target):
                        raise
                message = None
            if message is None:
                self._resume()
                continue
            item = self._state.receive(message)
            if isinstance(item, Frame | Event):
                yield item

    def _connect(self) -> None:
        """Opens or continues the stream and waits for its header."""
        opening = self._state.opening()
        if self._duplex:
            self._requests.put(None)  # lets the broken call's sender end
            self._requests = queue.SimpleQueue()
            self._requests.put(motion_pb2.AnimateRequest(open=opening))
            self._call = self._stub.Animate(iter(self._requests.get, None))
        else:
            self._call = self._stub.WatchFrames(motion_pb2.WatchFramesRequest(open=opening))
        header = self._read()
        if header is None:
            raise ConnectionFailedError(f"{self._target} closed the stream before its header")
        self._state.receive(header)

    def _read(self) -> motion_pb2.AnimateResponse | None:
        message = next(self._call, None)
        return message if message is None or self._duplex else message.message

    def _flush(self) -> None:
        for request in self._state.take_outbox():
            if self._duplex:
                self._requests.put(request)
            elif request.HasField("control"):
                self._stub.Control(motion_pb2.ControlRequest(session=self._state.session, control=request.control))
            elif acknowledgement := self._state.acknowledgement(request):
                self._stub.Acknowledge(acknowledgement)

    def _resume(self) -> None:
        for delay in resume_delays(self._resume_for):
            time.sleep(delay)
            try:
                return self._connect()
            except grpc.RpcError as error:
                if not breaks_stream(error):
                    with server_errors(self._target):
                        raise
            except ConnectionFailedError:
                continue
        raise ConnectionFailedError(
            f"the stream from {self._target} broke and could not be resumed in {self._resume_for:g} s"
        )
