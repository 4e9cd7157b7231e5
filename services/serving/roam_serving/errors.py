"""The error table: one row per reason, told alike over gRPC, HTTP and WebSocket.

    ErrorKind      a row: reason, gRPC code, HTTP status, title, remedy
    ServiceError   the exception: a row plus what happened this time
    COMMON         the rows every server has; each service adds its own

`problems` renders a ServiceError as RFC 9457 JSON, `statuses` as google.rpc.Status; the `reason` is the same on both.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from grpc import StatusCode as StatusCode  # services name codes without importing grpc


@dataclass(frozen=True)
class ErrorKind:
    """One row of the table."""

    reason: str  # UPPER_SNAKE_CASE, stable: clients may branch on it
    grpc_code: StatusCode
    http_status: int
    title: str  # what it means, whatever the request was
    remedy: str  # what the caller can do


class ServiceError(Exception):
    """A request that cannot be answered.

    `detail` says what happened this time, `field` names the request field at fault, `remedy` replaces the row's own
    advice by a better one, `retry_after` [s] says when another try makes sense.
    """

    def __init__(
        self,
        kind: ErrorKind,
        detail: str = "",
        *,
        field: str | None = None,
        remedy: str | None = None,
        retry_after: float | None = None,
    ) -> None:
        super().__init__(detail or kind.title)
        self.kind = kind
        self.detail = detail or kind.title
        self.field = field
        self.remedy = remedy or kind.remedy
        self.retry_after = retry_after


INVALID_ARGUMENT = ErrorKind(
    "INVALID_ARGUMENT",
    StatusCode.INVALID_ARGUMENT,
    400,
    "A field of the request is not valid",
    "Correct the named field; /docs and proto/README.md say what it takes.",
)
API_KEY_MISSING = ErrorKind(
    "API_KEY_MISSING",
    StatusCode.UNAUTHENTICATED,
    401,
    "The server wants an API key and the request has none",
    "Send `Authorization: Bearer KEY`, on gRPC as metadata; the client takes api_key, the command --api-key.",
)
API_KEY_UNKNOWN = ErrorKind(
    "API_KEY_UNKNOWN",
    StatusCode.UNAUTHENTICATED,
    401,
    "The server does not know the API key",
    "Check the key; whoever runs the server makes one with `python -m roam_serving.keys NAME --file FILE`.",
)
ORIGIN_NOT_ALLOWED = ErrorKind(
    "ORIGIN_NOT_ALLOWED",
    StatusCode.PERMISSION_DENIED,
    403,
    "A web page of another site asked",
    "Serve the page from this machine, or name its origin in ROAM_CORS_ORIGIN_REGEX on the server.",
)
HOST_NOT_ALLOWED = ErrorKind(
    "HOST_NOT_ALLOWED",
    StatusCode.PERMISSION_DENIED,
    403,
    "The server was asked under a name that is not its own",
    "Ask for it as localhost or by its address, or add the name to ROAM_ALLOWED_HOSTS on the server.",
)
ROUTE_NOT_FOUND = ErrorKind(
    "ROUTE_NOT_FOUND",
    StatusCode.UNIMPLEMENTED,
    404,
    "There is no such address or method",
    "See /docs for the addresses, or server reflection for the gRPC methods.",
)
METHOD_NOT_ALLOWED = ErrorKind(
    "METHOD_NOT_ALLOWED",
    StatusCode.UNIMPLEMENTED,
    405,
    "The address exists but not with this HTTP method",
    "Use a method named in the Allow header.",
)
UNSUPPORTED_MEDIA_TYPE = ErrorKind(
    "UNSUPPORTED_MEDIA_TYPE",
    StatusCode.INVALID_ARGUMENT,
    415,
    "The body is of a kind this address does not read",
    "Set Content-Type to one that /docs lists for this address.",
)
PAYLOAD_TOO_LARGE = ErrorKind(
    "PAYLOAD_TOO_LARGE",
    StatusCode.RESOURCE_EXHAUSTED,
    413,
    "The request is larger than the server accepts",
    "Send a smaller file (decimate the mesh, drop textures), or raise ROAM_MAX_UPLOAD_BYTES on the server.",
)
QUEUE_FULL = ErrorKind(
    "QUEUE_FULL",
    StatusCode.RESOURCE_EXHAUSTED,
    429,
    "The server has as much work waiting as it accepts",
    "Try again after the time given in Retry-After or RetryInfo.",
)
RATE_LIMITED = ErrorKind(
    "RATE_LIMITED",
    StatusCode.RESOURCE_EXHAUSTED,
    429,
    "The caller sends requests faster than it may",
    "Wait as long as Retry-After or RetryInfo says; ROAM_REQUESTS_PER_SECOND on the server sets the rate.",
)
NOT_READY = ErrorKind(
    "NOT_READY",
    StatusCode.UNAVAILABLE,
    503,
    "The server is not ready yet",
    "Wait until /readyz answers 200; its body says what is missing.",
)
DRAINING = ErrorKind(
    "DRAINING",
    StatusCode.UNAVAILABLE,
    503,
    "The server is shutting down",
    "Send the request to another replica.",
)
CANCELLED = ErrorKind(
    "CANCELLED",
    StatusCode.CANCELLED,
    499,
    "The caller gave up before the answer was there",
    "Nothing to do; send the request again if the answer is still wanted.",
)
INTERNAL = ErrorKind(
    "INTERNAL",
    StatusCode.INTERNAL,
    500,
    "The server made a mistake",
    "Report it with the request id; the server's log has the trace under that id.",
)

COMMON: tuple[ErrorKind, ...] = (
    INVALID_ARGUMENT,
    API_KEY_MISSING,
    API_KEY_UNKNOWN,
    ORIGIN_NOT_ALLOWED,
    HOST_NOT_ALLOWED,
    ROUTE_NOT_FOUND,
    METHOD_NOT_ALLOWED,
    UNSUPPORTED_MEDIA_TYPE,
    PAYLOAD_TOO_LARGE,
    QUEUE_FULL,
    RATE_LIMITED,
    NOT_READY,
    DRAINING,
    CANCELLED,
    INTERNAL,
)


def by_reason(kinds: Iterable[ErrorKind]) -> dict[str, ErrorKind]:
    """The rows by reason; ValueError when two rows share one."""
    table: dict[str, ErrorKind] = {}
    for kind in kinds:
        if table.setdefault(kind.reason, kind) != kind:
            raise ValueError(f"two rows of the error table have the reason {kind.reason}")
    return table


def table_markdown(sections: Iterable[tuple[str, Iterable[ErrorKind]]]) -> str:
    """The table as docs/reference/errors.md shows it: one section per (heading, rows)."""
    lines: list[str] = []
    for heading, kinds in sections:
        lines += [f"## {heading}", "", "| reason | gRPC | HTTP | meaning | what to do |", "|---|---|---|---|---|"]
        lines += [f"| `{k.reason}` | {k.grpc_code.name} | {k.http_status} | {k.title} | {k.remedy} |" for k in kinds]
        lines.append("")
    return "\n".join(lines)
