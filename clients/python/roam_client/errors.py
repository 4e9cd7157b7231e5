"""What can go wrong, in one tree.

    RoamError
    ├── ServerError                 the server answered: no. Carries reason, remedy, code, fields
    │   ├── InvalidRequestError     the request or the object file is at fault; fix it, do not retry
    │   ├── NotFoundError           no such object, session, reference pose or skeleton (or it expired)
    │   ├── ConflictError           the state of the thing forbids it, for example a session that has ended
    │   ├── AccessDeniedError       no key, a wrong key, or not allowed
    │   ├── UnavailableError        not ready, shutting down, queue or quota full; retry after `retry_after` seconds
    │   └── InternalServerError     a defect or a limit of the server
    ├── ConnectionFailedError       no server there, or the connection broke and could not be resumed
    ├── RequestTimeoutError         no answer within the time that was given
    ├── WireError                   bytes that do not fit their header: client and server disagree about the protocol
    └── FormatError                 a file name whose ending nothing here can read or write

Every error is a sentence for people; `reason` is the stable word for programs (see the server's error table).
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import grpc
from google.protobuf.any_pb2 import Any as AnyMessage
from google.rpc import error_details_pb2, status_pb2


@dataclass(frozen=True)
class FieldViolation:
    """One field of the request that the server refused, and why."""

    field: str
    description: str


class RoamError(Exception):
    """Base of everything that this package raises on purpose."""


class ServerError(RoamError):
    """The server refused or failed."""

    def __init__(
        self,
        message: str,
        *,
        reason: str = "UNKNOWN",
        remedy: str = "",
        code: grpc.StatusCode = grpc.StatusCode.UNKNOWN,
        fields: Sequence[FieldViolation] = (),
        retry_after: float | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.reason = reason
        self.remedy = remedy
        self.code = code
        self.fields = tuple(fields)
        self.retry_after = retry_after  # [s]

    def __str__(self) -> str:
        return f"{self.message} ({self.reason})" if self.reason != "UNKNOWN" else self.message


class InvalidRequestError(ServerError):
    """The request or the object file is at fault."""


class NotFoundError(ServerError):
    """No such object, session, reference pose or skeleton."""


class ConflictError(ServerError):
    """The state of the thing forbids it."""


class AccessDeniedError(ServerError):
    """No key, a wrong key, or not allowed."""


class UnavailableError(ServerError):
    """Not ready, shutting down, or a queue or quota is full: the same request may succeed later."""


class InternalServerError(ServerError):
    """A defect or a limit of the server."""


class ConnectionFailedError(RoamError):
    """No server there, or the connection broke and could not be resumed."""


class RequestTimeoutError(RoamError):
    """No answer within the time that was given."""


class WireError(RoamError):
    """Bytes that do not fit their own header."""


class FormatError(RoamError):
    """A file ending that nothing here can write."""


_Code = grpc.StatusCode
_CLASSES: dict[grpc.StatusCode, type[ServerError]] = {
    _Code.INVALID_ARGUMENT: InvalidRequestError,
    _Code.OUT_OF_RANGE: InvalidRequestError,
    _Code.NOT_FOUND: NotFoundError,
    _Code.ALREADY_EXISTS: ConflictError,
    _Code.FAILED_PRECONDITION: ConflictError,
    _Code.ABORTED: ConflictError,
    _Code.UNAUTHENTICATED: AccessDeniedError,
    _Code.PERMISSION_DENIED: AccessDeniedError,
    _Code.RESOURCE_EXHAUSTED: UnavailableError,
    _Code.UNAVAILABLE: UnavailableError,
}
# A body over the limit shares its gRPC code with a full queue, but no retry helps.
_BY_REASON: dict[str, type[ServerError]] = {"PAYLOAD_TOO_LARGE": InvalidRequestError}

_DETAILS = "grpc-status-details-bin"


def _unpack(details: Sequence[AnyMessage], kind: type[Any]) -> Any:
    """The first detail of a kind, or an empty one."""
    message = kind()
    for detail in details:
        if detail.Is(kind.DESCRIPTOR):
            detail.Unpack(message)
            break
    return message


def _details(error: Any) -> Sequence[AnyMessage]:
    """The google.rpc.Status details that came with a gRPC error, of either client."""
    trailers = dict(error.trailing_metadata() or ())
    payload = trailers.get(_DETAILS)
    if not isinstance(payload, bytes):
        return ()
    status = status_pb2.Status()
    status.ParseFromString(payload)
    return tuple(status.details)


def error_from_rpc(error: grpc.RpcError, target: str) -> RoamError:
    """The error of this tree for a failed call to `target` (host:port)."""
    call: Any = error
    code: grpc.StatusCode = call.code()
    message = str(call.details() or code.name.lower().replace("_", " "))
    details = _details(call)
    info = _unpack(details, error_details_pb2.ErrorInfo)
    if code is _Code.UNAVAILABLE and not info.reason:
        return ConnectionFailedError(f"no answer from {target}: {message}")
    if code is _Code.DEADLINE_EXCEEDED and not info.reason:
        return RequestTimeoutError(f"{target} did not answer in time")
    retry = _unpack(details, error_details_pb2.RetryInfo)
    violations = _unpack(details, error_details_pb2.BadRequest).field_violations
    kind = _BY_REASON.get(info.reason) or _CLASSES.get(code, InternalServerError)
    return kind(
        message,
        reason=info.reason or code.name,
        remedy=info.metadata.get("remedy", ""),
        code=code,
        fields=[FieldViolation(v.field, v.description) for v in violations],
        retry_after=retry.retry_delay.ToTimedelta().total_seconds() if retry.HasField("retry_delay") else None,
    )


@contextmanager
def server_errors(target: str) -> Iterator[None]:
    """Turns gRPC errors inside the block into errors of this tree."""
    try:
        yield
    except grpc.RpcError as error:
        raise error_from_rpc(error, target) from error
