"""Channels and retries: shared by both twins."""

from collections.abc import Iterator
from typing import Any

import grpc

from roam_client.errors import RoamError

# Uploads come in 1 MiB chunks and frames are tiny, but a reference pose with its object can pass gRPC's default 4 MiB.
CHANNEL_OPTIONS: tuple[tuple[str, int], ...] = (
    ("grpc.max_receive_message_length", 64 << 20),
    ("grpc.enable_retries", 0),
)

_BROKEN = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.INTERNAL, grpc.StatusCode.UNKNOWN)


def required(address: str | None, service: str) -> str:
    """The address, or an error that says which one is missing."""
    if address is None:
        raise RoamError(f"this client was made without an address of the {service} service; pass {service}='host:port'")
    return address


def breaks_stream(error: grpc.RpcError) -> bool:
    """True when the connection is at fault and the stream may be resumed; false when the server said no."""
    call: Any = error
    return call.code() is grpc.StatusCode.UNAVAILABLE or (
        call.code() in _BROKEN and "RST_STREAM" in str(call.details())
    )


def resume_delays(seconds: float) -> Iterator[float]:
    """Pauses [s] between attempts that together take about `seconds`: 0, 0.05, 0.1, 0.2, … 1."""
    pause, spent = 0.0, 0.0
    while spent <= seconds:
        yield pause
        spent += pause
        pause = min(1.0, max(0.05, pause * 2))
