"""Errors on WebSocket: a close code of 4000 + HTTP status, and the reason of the error table."""

from roam_serving.errors import ServiceError

_BASE = 4000  # the first of the codes that RFC 6455 leaves to applications


def closing(error: ServiceError) -> tuple[int, str]:
    """Close code and close reason of an error."""
    return _BASE + error.kind.http_status, error.kind.reason
