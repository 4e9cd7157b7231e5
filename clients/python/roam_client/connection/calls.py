"""What a client asks of a server and how often it tries: shared by both clients, does no input or output itself.

A method of the client is a *plan*: a generator that yields calls and is sent their answers. `Client` runs a plan with
blocking calls, `AsyncClient` with awaited ones; everything else is the same.

    def _session(self, name: str) -> Plan[motion_pb2.Session]:
        response = yield Call(MOTION, "GetSession", motion_pb2.GetSessionRequest(name=name), session=name)
        return response.session
"""

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any, TypeVar

import grpc

from roam_client.connection.transport import breaks_stream
from roam_client.errors import error_from_rpc

Answer = TypeVar("Answer")

GOALPOSE = "goalpose"
MOTION = "motion"

RETRY_SECONDS = 10.0  # a server that was there and is not any more is looked for this long
ATTEMPT_SECONDS = 3.0  # a short call without an answer by then is tried elsewhere; each further try gets twice that


@dataclass(frozen=True)
class Call:
    """One request, safe to send again: the server knows it by its id, or it changes nothing."""

    service: str  # GOALPOSE or MOTION
    method: str
    request: Any  # a message, or a function that makes the messages of a stream
    stub: type[Any]  # of the generated ones
    session: str = ""  # gateways route by it
    timeout: float | None = None  # [s]; None: the client's
    on_message: Callable[[Any], bool] | None = None  # the answer is a stream; True for the message that ends it

    @property
    def short(self) -> bool:
        """Whether an answer comes in milliseconds where the server is well: calls about sessions."""
        return self.service == MOTION and self.on_message is None


Plan = Generator[Call, Any, Answer]


@dataclass
class Attempts:
    """The tries of one call."""

    target: str
    call: Call
    timeout: float  # [s] for all of them together
    reached: bool  # whether the target has ever answered this client
    started: float = 0.0
    count: int = 0

    def __post_init__(self) -> None:
        self.started = time.monotonic()

    @property
    def seconds(self) -> float:
        """How long the next attempt may take."""
        left = max(0.001, self.timeout - (time.monotonic() - self.started))
        return min(left, ATTEMPT_SECONDS * 2**self.count) if self.call.short else left

    def pause(self, error: grpc.RpcError) -> float:
        """How long to wait before the next attempt [s]. The error of `roam_client.errors` when none is to be made."""
        spent = time.monotonic() - self.started
        wait = min(1.0, 0.05 * 2**self.count)
        self.count += 1
        limit = min(self.timeout, RETRY_SECONDS) if self.reached else 0.0
        late = is_silence(error) and self.call.short and spent + wait < self.timeout
        if late or (breaks_stream(error) and spent + wait < limit):
            return wait
        raise error_from_rpc(error, self.target) from error


def is_silence(error: grpc.RpcError) -> bool:
    """Whether an attempt ran out of time: another connection may fare better."""
    call: Any = error
    return call.code() is grpc.StatusCode.DEADLINE_EXCEEDED
