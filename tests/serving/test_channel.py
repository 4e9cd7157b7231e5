"""Options of gRPC connections: known to the installed library, and doing what they are set for."""

import asyncio
from pathlib import Path

import grpc
import pytest
from echo import Echo
from grpc._cython import cygrpc
from roam_serving.rpc.channel import SERVER_OPTIONS
from roam_serving.server import running
from roam_serving.settings import ServerSettings

LIBRARY = Path(cygrpc.__file__).read_bytes()


@pytest.mark.parametrize("name", sorted({name for name, _ in SERVER_OPTIONS}))
def test_the_library_knows_every_option(name):
    assert name.encode() + b"\0" in LIBRARY


def test_a_name_that_the_library_does_not_know_would_be_seen():
    assert b"grpc.http2.min_recv_ping_interval_without_data_ms\0" not in LIBRARY


async def test_an_idle_connection_that_pings_every_second_stays_open():
    """By default the third ping ends it: GOAWAY, too_many_pings."""
    options = [
        ("grpc.keepalive_time_ms", 1_100),
        ("grpc.keepalive_permit_without_calls", 1),
        ("grpc.http2.max_pings_without_data", 0),
    ]
    async with (
        running([Echo()], ServerSettings()) as addresses,
        grpc.aio.insecure_channel(addresses.grpc, options) as channel,
    ):
        await channel.channel_ready()
        changed = asyncio.create_task(channel.wait_for_state_change(grpc.ChannelConnectivity.READY))
        done, _ = await asyncio.wait([changed], timeout=6)
        changed.cancel()
        assert not done, f"the connection was closed: {channel.get_state()}"
