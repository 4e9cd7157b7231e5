"""Channels and retries: shared by both clients."""

from collections.abc import Iterator
from typing import Any

import grpc

from roam_client.errors import RoamError

# Uploads come in 1 MiB chunks and frames are tiny, but a reference pose with its object can pass gRPC's default 4 MiB.
CHANNEL_OPTIONS: tuple[tuple[str, int], ...] = (
    ("grpc.max_receive_message_length", 64 << 20),
    ("grpc.enable_retries", 0),
    # A stream that broke comes back as soon as a server is there; gRPC's own first pause is a second.
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.min_reconnect_backoff_ms", 1000),
    ("grpc.max_reconnect_backoff_ms", 2000),
    # A network that drops everything says nothing: ask the server now and then while calls are under way.
    ("grpc.keepalive_time_ms", 10_000),
    ("grpc.keepalive_timeout_ms", 5_000),
    ("grpc.http2.max_pings_without_data", 0),
    # A client that gives up a connection must not be handed the same one again.
    ("grpc.use_local_subchannel_pool", 1),
)

# How gRPC words a call that this side cancelled.
_OWN_CANCEL = "Locally cancelled"
# How gRPC's core words a connection that went away under a call, besides UNAVAILABLE: a reset, or a write that came too
# late. If it was the server who said no, reopening the stream tells.
_BROKEN_DETAILS = ("RST_STREAM", "Internal error from Core")


def required(address: str | None, service: str) -> str:
    """The address, or an error that says which one is missing."""
    if address is None:
        raise RoamError(f"this client was made without an address of the {service} service; pass {service}='host:port'")
    return address


def breaks_stream(error: grpc.RpcError) -> bool:
    """True when the connection is at fault and the stream may be resumed; false when the server said no."""
    call: Any = error
    if call.code() is grpc.StatusCode.UNAVAILABLE:
        return True
    if call.code() is grpc.StatusCode.CANCELLED:  # by a server that shuts down; else it was this side that left
        return _OWN_CANCEL not in str(call.details())
    return any(words in str(call.details()) for words in _BROKEN_DETAILS)


def resume_delays(seconds: float) -> Iterator[float]:
    """Pauses [s] between attempts that together take about `seconds`: 0, 0.05, 0.1, 0.2, … 1."""
    pause, spent = 0.0, 0.0
    while spent <= seconds:
        yield pause
        spent += pause
        pause = min(1.0, max(0.05, pause * 2))
