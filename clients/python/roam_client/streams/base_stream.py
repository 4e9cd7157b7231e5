"""What both kinds of frame stream decide alike: when a stream is broken, when it is over. No input or output."""

from typing import Any

import grpc
from roam.v1 import motion_pb2

from roam_client.connection.transport import breaks_stream
from roam_client.errors import ConnectionFailedError, error_from_rpc
from roam_client.streams.stream_state import StreamState
from roam_client.types.frames import Header

HEADER_SECONDS = 3.0  # a server that has not opened the stream by then is silent
CALL_SECONDS = 3.0  # the same for an acknowledgement or a control beside the stream


class BaseStream:
    """State and decisions of a stream; see `Stream` and `AsyncStream`."""

    def __init__(self, state: StreamState, *, target: str, duplex: bool, resume_for: float) -> None:
        self._state = state
        self._target = target
        self._duplex = duplex
        self._resume_for = resume_for  # [s] of silence after which a broken stream is given up
        self._call: Any = None
        self._left = False  # by `close`, perhaps from another thread or task

    @property
    def header(self) -> Header:
        """The header in force: skeleton, frame rate. Known as soon as the stream is open."""
        if self._state.header is None:
            raise RuntimeError("open the stream first: with session.stream() as stream")
        return self._state.header

    def _check(self, error: grpc.RpcError) -> None:
        """Raises the error of `roam_client.errors` unless the connection is at fault and the stream can be resumed."""
        if not breaks_stream(error):
            raise error_from_rpc(error, self._target) from error

    def _given_up(self) -> ConnectionFailedError:
        return ConnectionFailedError(
            f"the stream from {self._target} broke and could not be resumed in {self._resume_for:g} s"
        )

    def _headless(self) -> ConnectionFailedError:
        return ConnectionFailedError(f"{self._target} closed the stream before its header")

    def _control_request(self, request: motion_pb2.AnimateRequest) -> motion_pb2.ControlRequest:
        """A control as a call of its own, beside a stream that only goes down."""
        return motion_pb2.ControlRequest(session=self._state.session, control=request.control)
