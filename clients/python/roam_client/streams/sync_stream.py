"""Frame streams for ordinary code: `base_stream` with blocking reads."""

import queue
import threading
import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any, Self

import grpc
from roam.v1 import motion_pb2

from roam_client.connection.transport import breaks_stream, resume_delays
from roam_client.errors import ConnectionFailedError, error_from_rpc
from roam_client.streams.base_stream import CALL_SECONDS, HEADER_SECONDS, BaseStream
from roam_client.streams.stream_state import StreamState
from roam_client.types.frames import Event, Frame

Requests = queue.SimpleQueue[motion_pb2.AnimateRequest | None]
Connect = Callable[[bool], Any]  # a stub of the motion service; True: on a connection of its own


class Stream(BaseStream):
    """Iterates over frames and events of one session; a broken or silent connection is resumed where it left off.

    Opened by `Session.stream` (both directions in one call) or `Session.watch` (frames; controls travel beside it).
    `close` may be called from any thread; a loop over the stream then ends.
    """

    def __init__(self, connect: Connect, state: StreamState, *, target: str, duplex: bool, resume_for: float) -> None:
        super().__init__(state, target=target, duplex=duplex, resume_for=resume_for)
        self._connecting = connect
        self._stub: Any = None
        self._requests: Requests = queue.SimpleQueue()
        self._leaving = threading.Event()
        self._watch = _SilenceWatch(self._cut)

    def __enter__(self) -> Self:
        if not self._resume(first=True):
            raise ConnectionFailedError("the stream was closed while it opened")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leaves the stream; the session lives on."""
        self._left = True
        self._leaving.set()
        self._watch.stop()
        self._requests.put(None)
        self._cut()

    def send(self, control: motion_pb2.ControlInput) -> None:
        """Sends a control, now or, if the connection is just broken, after it is back."""
        request = self._state.control(control)
        if self._duplex:
            self._requests.put(request)
        else:
            self._send_beside(request)

    def frames(self) -> Iterator[Frame]:
        """Only the frames."""
        return (item for item in self if isinstance(item, Frame))

    def __iter__(self) -> Iterator[Frame | Event]:
        while not self._state.ended and not self._left:
            # Acknowledged only now, when the caller has done with the last frame: that is what "slow reader" means.
            self._flush()
            message = self._next()
            if message is None:
                if self._left or not self._resume():
                    return
                continue
            item = self._state.receive(message)
            if isinstance(item, Frame | Event):
                yield item

    def _next(self) -> motion_pb2.AnimateResponse | None:
        """The next message; None when the connection has ended, was silent for too long, or the stream was left."""
        try:
            return self._read(self._state.patience)
        except grpc.RpcError as error:
            if self._watch.fired:
                self._state.quiet += 1
            elif not self._left:
                self._check(error)
            return None

    def _read(self, patience: float | None) -> motion_pb2.AnimateResponse | None:
        with self._watch.limit(patience):
            message = next(self._call, None)
        return message if message is None or self._duplex else message.message

    def _connect(self) -> None:
        """Opens or continues the stream and waits for its header."""
        self._stub = self._connecting(self._watch.fired)
        self._watch.fired = False
        opening = self._state.opening()
        if self._duplex:
            self._requests.put(None)  # lets the broken call's sender end
            self._requests = queue.SimpleQueue()
            self._requests.put(motion_pb2.AnimateRequest(open=opening))
            self._call = self._stub.Animate(iter(self._requests.get, None))
        else:
            self._call = self._stub.WatchFrames(motion_pb2.WatchFramesRequest(open=opening))
        if self._left:  # while it opened
            self._cut()
        header = self._read(HEADER_SECONDS)
        if header is None:
            raise self._headless()
        self._state.receive(header)

    def _resume(self, *, first: bool = False) -> bool:
        """Opens the stream, again and again for a while; False when it was left meanwhile."""
        failure: Exception = self._given_up()
        ends = time.monotonic() + self._resume_for
        for delay in resume_delays(self._resume_for):
            if self._leaving.wait(delay):
                return False
            try:
                self._connect()
                return True
            except grpc.RpcError as error:
                if self._left:
                    return False
                if not self._watch.fired:
                    self._check(error)
                failure = error_from_rpc(error, self._target) if first else failure
            except ConnectionFailedError as error:
                failure = error if first else failure
            if time.monotonic() > ends:
                break
        raise failure

    def _flush(self) -> None:
        for request in self._state.take_outbox():
            if self._duplex:
                self._requests.put(request)
            elif request.HasField("control"):
                self._send_beside(request)
            elif acknowledgement := self._state.acknowledgement(request):
                try:
                    self._stub.Acknowledge(acknowledgement, timeout=CALL_SECONDS)
                except grpc.RpcError:  # the stream itself tells what is wrong
                    return

    def _send_beside(self, request: motion_pb2.AnimateRequest) -> None:
        try:
            self._stub.Control(self._control_request(request), timeout=CALL_SECONDS)
        except grpc.RpcError as error:
            if not breaks_stream(error):  # else it is sent again when the stream is back
                self._check(error)

    def _cut(self) -> None:
        call = self._call
        if call is not None:
            call.cancel()


class _SilenceWatch:
    """Cuts a read that takes too long: gRPC's blocking iterator has no time limit of its own."""

    def __init__(self, cut: Callable[[], None]) -> None:
        self.fired = False  # whether the last connection was cut for its silence
        self._cut = cut
        self._deadline: float | None = None
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    def limit(self, seconds: float | None) -> "_SilenceWatch":
        """For a `with` block around one read."""
        if seconds is None or self._stopped.is_set():
            return self
        self._deadline = time.monotonic() + seconds
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="roam-silence", daemon=True)
            self._thread.start()
        return self

    def __enter__(self) -> None:
        return None

    def __exit__(self, *_: object) -> None:
        self._deadline = None

    def stop(self) -> None:
        """Ends the thread."""
        self._stopped.set()

    def _run(self) -> None:
        while not self._stopped.wait(0.1):
            deadline = self._deadline
            if deadline is not None and time.monotonic() > deadline:
                self._deadline = None
                self.fired = True
                self._cut()
