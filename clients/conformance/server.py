"""A motion server that plays one recorded session and notes what the client does wrong."""

import threading
import time
from collections.abc import Iterator
from concurrent import futures
from contextlib import contextmanager
from typing import Any

import grpc
from google.protobuf import any_pb2
from google.rpc import error_details_pb2, status_pb2
from grpc_status import rpc_status
from roam.v1 import motion_pb2, motion_pb2_grpc
from script import Script, Step, differences, response

PATIENCE = 6.0  # [s] for what a client must do


class _MistakeError(Exception):
    """The client did something else than the script says."""


class _Incoming:
    """What has come on one connection."""

    def __init__(self, requests: Iterator[motion_pb2.AnimateRequest]) -> None:
        self.opening = next(requests, motion_pb2.AnimateRequest()).open
        self.controls: list[motion_pb2.ControlInput] = []
        self.acknowledged = -1
        self._requests = requests
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        try:
            for request in self._requests:
                if request.HasField("control"):
                    self.controls.append(request.control)
                elif request.HasField("ack"):
                    self.acknowledged = max(self.acknowledged, request.ack.sequence)
        except grpc.RpcError:
            return


class ScriptedServer(motion_pb2_grpc.MotionServiceServicer):
    """Plays the connections of a script one after the other, whoever opens them."""

    # ruff: noqa: N802  # methods carry gRPC's names

    def __init__(self, script: Script) -> None:
        self.mistakes: list[str] = []
        self.played = 0
        self._script = script

    def GetSession(self, request: motion_pb2.GetSessionRequest, context: Any) -> motion_pb2.GetSessionResponse:
        """The session of the script, whatever its name."""
        return motion_pb2.GetSessionResponse(session=motion_pb2.Session(name=request.name, frame_rate=30))

    def Animate(
        self, request_iterator: Iterator[motion_pb2.AnimateRequest], context: Any
    ) -> Iterator[motion_pb2.AnimateResponse]:
        """The next connection of the script."""
        incoming = _Incoming(request_iterator)
        if self.played == len(self._script.connections):
            self.mistakes.append("the client opened the stream once more than it should")
            return
        steps = self._script.connections[self.played]
        self.played += 1
        for number, step in enumerate(steps, start=1):
            try:
                yield from self._play(step, incoming, context)
            except _MistakeError as mistake:
                self.mistakes.append(f"connection {self.played}, step {number}: {mistake}")
                return
        if "end" not in steps[-1]:
            _until_left(context)

    def _play(self, step: Step, incoming: _Incoming, context: Any) -> Iterator[motion_pb2.AnimateResponse]:
        match step:
            case {"expect_open": wanted}:
                if wrong := differences(incoming.opening, wanted):
                    raise _MistakeError(f"Open is wrong: {'; '.join(wrong)}")
            case {"wait_ack": sequence}:
                _wait(lambda: incoming.acknowledged >= sequence, f"no acknowledgement of frame {sequence}", context)
            case {"wait_control": wanted}:
                _wait(lambda: _found(incoming.controls, wanted), f"no control with {wanted}", context)
            case {"no_control": _}:
                if incoming.controls:
                    raise _MistakeError(f"a control came that the server has already: {incoming.controls[0]}")
            case {"pause": seconds}:
                time.sleep(seconds)
            case {"silence": seconds}:
                _wait(lambda: not context.is_active(), f"the client still waits after {seconds} s", context, seconds)
            case {"end": code}:
                _end(context, code, step.get("reason", ""))
            case _:
                yield response(step)


def _found(controls: list[motion_pb2.ControlInput], wanted: dict[str, Any]) -> bool:
    return any(not differences(control, wanted) for control in controls)


def _wait(done: Any, mistake: str, context: Any, seconds: float = PATIENCE) -> None:
    ends = time.monotonic() + seconds
    while not done():
        if time.monotonic() > ends or not context.is_active():
            raise _MistakeError(mistake)
        time.sleep(0.005)


def _until_left(context: Any) -> None:
    """The stream stays open until the client has what it wants: some libraries drop what is unread when a call ends."""
    ends = time.monotonic() + PATIENCE
    while context.is_active() and time.monotonic() < ends:
        time.sleep(0.005)


def _end(context: Any, code: str, reason: str) -> None:
    if code == "OK":
        return
    status = getattr(grpc.StatusCode, code)
    if not reason:
        context.abort(status, "the connection is lost")
    detail = any_pb2.Any()
    detail.Pack(error_details_pb2.ErrorInfo(reason=reason, domain="roam"))
    context.abort_with_status(
        rpc_status.to_status(status_pb2.Status(code=status.value[0], message=reason, details=[detail]))
    )


@contextmanager
def scripted_server(script: Script) -> Iterator[tuple[ScriptedServer, str]]:
    """The server and its address until the block ends."""
    servicer = ScriptedServer(script)
    server = grpc.server(futures.ThreadPoolExecutor(8))
    motion_pb2_grpc.add_MotionServiceServicer_to_server(servicer, server)
    address = f"127.0.0.1:{server.add_insecure_port('127.0.0.1:0')}"
    server.start()
    try:
        yield servicer, address
    finally:
        server.stop(None)
