"""One loop, two ports: health, readiness, metrics, docs, reflection, start and stop."""

import asyncio
import os
import signal
import sys
from pathlib import Path

import grpc
import httpx
import pytest
from echo import Echo
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection_pb2, reflection_pb2_grpc
from roam.v1 import server_pb2, server_pb2_grpc
from roam_serving.server import Server, running
from roam_serving.settings import ServerSettings

SERVING = health_pb2.HealthCheckResponse.SERVING


async def grpc_health(address: str, service: str = "") -> int:
    async with grpc.aio.insecure_channel(address) as channel:
        answer = await health_pb2_grpc.HealthStub(channel).Check(health_pb2.HealthCheckRequest(service=service))
    return answer.status


async def test_ready_only_when_loaded_and_alive_before():
    loaded = asyncio.Event()
    server = Server([Echo(loaded=loaded)], ServerSettings())
    await server.open()
    try:
        loading = asyncio.create_task(server.load())
        async with httpx.AsyncClient(base_url=server.addresses.http) as client:
            assert (await client.get("/livez")).status_code == 200
            blocked = await client.get("/readyz")
            assert blocked.status_code == 503
            assert blocked.json()["blockers"] == {"models": "loading"}
            assert await grpc_health(server.addresses.grpc) != SERVING
            loaded.set()
            await loading
            assert (await client.get("/readyz")).json() == {"status": "ready", "blockers": {}}
            assert await grpc_health(server.addresses.grpc) == SERVING
            assert await grpc_health(server.addresses.grpc, "roam.v1.ServerService") == SERVING
    finally:
        await server.close(0.1)


async def test_binds_to_loopback_and_to_free_ports():
    async with running([Echo()], ServerSettings()) as one, running([Echo()], ServerSettings()) as two:
        assert one.http.startswith("http://127.0.0.1:")
        assert one.grpc.startswith("127.0.0.1:")
        assert len({one.http, two.http, one.grpc, two.grpc}) == 4


async def test_a_taken_port_is_a_clear_error():
    async with running([Echo()], ServerSettings()) as addresses:
        port = int(addresses.http.rpartition(":")[2])
        with pytest.raises(OSError, match="choose another HTTP port"):
            async with running([Echo()], ServerSettings(http_port=port)):
                pass


async def test_metrics_count_requests_and_request_ids_come_back():
    async with running([Echo()], ServerSettings()) as addresses, httpx.AsyncClient(base_url=addresses.http) as client:
        answer = await client.post("/number", json={"number": 3}, headers={"X-Request-Id": "abc-1"})
        assert answer.headers["x-request-id"] == "abc-1"
        odd = await client.post("/number", json={"number": 3}, headers={"X-Request-Id": "a b"})
        assert odd.headers["x-request-id"] != "a b"
        await grpc_health(addresses.grpc)
        text = (await client.get("/metrics")).text
        assert 'roam_requests_total{code="200",method="POST /number",transport="http"} 2.0' in text
        assert 'method="/grpc.health.v1.Health/Check",transport="grpc"} 1.0' in text
        assert "process_cpu_seconds_total" in text


async def test_docs_need_no_other_host():
    async with running([Echo()], ServerSettings()) as addresses, httpx.AsyncClient(base_url=addresses.http) as client:
        page = (await client.get("/docs")).text
        assert "https://" not in page
        assert (await client.get("/static-offline-docs/swagger-ui-bundle.js")).status_code == 200
        assert "/number" in (await client.get("/openapi.json")).json()["paths"]


async def test_reflection_lists_the_services():
    async def ask():
        yield reflection_pb2.ServerReflectionRequest(list_services="")

    async with running([Echo()], ServerSettings()) as addresses, grpc.aio.insecure_channel(addresses.grpc) as channel:
        call = reflection_pb2_grpc.ServerReflectionStub(channel).ServerReflectionInfo(ask())
        names = [service.name async for answer in call for service in answer.list_services_response.service]
    assert {"roam.v1.ServerService", "roam.v1.SkeletonService", "grpc.health.v1.Health", "echo.Echo"} <= set(names)


async def test_server_info_is_the_same_on_both_transports():
    async with running([Echo()], ServerSettings()) as addresses, httpx.AsyncClient(base_url=addresses.http) as client:
        told = (await client.get("/v1/server")).json()
        async with grpc.aio.insecure_channel(addresses.grpc) as channel:
            stub = server_pb2_grpc.ServerServiceStub(channel)
            info = await stub.GetServerInfo(server_pb2.GetServerInfoRequest())
    assert told["services"] == list(info.services) == ["echo"]
    assert told["models"] == dict(info.models) == {"echo": "sha256:00"}
    assert told["limits"] == dict(info.limits) == {"max_words": 3}
    assert told["version"] == info.version


async def test_web_pages_of_this_machine_may_call_and_others_not():
    async with running([Echo()], ServerSettings()) as addresses, httpx.AsyncClient(base_url=addresses.http) as client:
        near = await client.get("/livez", headers={"Origin": "http://127.0.0.1:5173"})
        own = await client.get("/v1/server", headers={"Origin": addresses.http})
        far = await client.get("/livez", headers={"Origin": "https://example.org"})
    assert near.headers["access-control-allow-origin"] == "http://127.0.0.1:5173"
    assert own.status_code == 200
    assert (far.status_code, far.json()["reason"]) == (403, "ORIGIN_NOT_ALLOWED")
    assert "access-control-allow-origin" not in far.headers


@pytest.mark.parametrize(
    "host", ["rebound.example", "rebound.example:80", "127.0.0.1.example", "localhost.example", "[::2]"]
)
async def test_a_page_whose_name_leads_here_is_refused(host):
    async with running([Echo()], ServerSettings()) as addresses, httpx.AsyncClient(base_url=addresses.http) as client:
        rebound = await client.get("/v1/server", headers={"Origin": f"http://{host}", "Host": host})
        probe = await client.get("/readyz", headers={"Host": host})
    assert (rebound.status_code, rebound.json()["reason"]) == (403, "HOST_NOT_ALLOWED")
    assert probe.status_code == 200


@pytest.mark.parametrize(
    ("host", "allowed"),
    [("studio:8080", "studio"), ("Studio", "other, studio"), ("anything", "*"), ("[::1]:80", "[::1]")],
)
async def test_names_that_are_allowed_may_ask(host, allowed):
    settings = ServerSettings(allowed_hosts=allowed)
    async with running([Echo()], settings) as addresses, httpx.AsyncClient(base_url=addresses.http) as client:
        answer = await client.get("/v1/server", headers={"Origin": f"http://{host}", "Host": host})
    assert answer.status_code == 200


async def test_a_part_that_failed_for_good_ends_the_liveness():
    server = Server([Echo()], ServerSettings())
    await server.open()
    try:
        await server.load()
        server.readiness.fail("ticker", "it ended")
        async with httpx.AsyncClient(base_url=server.addresses.http) as client:
            alive, ready = await client.get("/livez"), await client.get("/readyz")
    finally:
        await server.close(0.1)
    assert (alive.status_code, alive.json()["failures"]) == (503, {"ticker": "it ended"})
    assert (ready.status_code, ready.json()["blockers"]) == (503, {"ticker": "it ended"})


async def test_running_requests_finish_before_the_server_closes():
    echo = Echo()
    server = Server([echo], ServerSettings())
    await server.open()
    await server.load()
    async with httpx.AsyncClient(base_url=server.addresses.http) as client:
        request = asyncio.create_task(client.get("/slow"))
        await echo.started.wait()
        await server.close(5)
        assert (await request).json() == "done"
    assert echo.closed
    assert not server.readiness.ready


async def test_sigterm_ends_the_process_with_code_0(tmp_path):
    program = (
        "from echo import Echo\n"
        "from roam_serving.server import serve\n"
        "from roam_serving.settings import ServerSettings\n"
        "serve([Echo()], ServerSettings())\n"
    )
    paths = [str(Path(__file__).parent), *(p for p in sys.path if p)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", program, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE, env=environment
    )
    assert process.stdout
    line = (await process.stdout.readline()).decode()
    assert line.startswith("ready http=http://127.0.0.1:")
    process.send_signal(signal.SIGTERM)
    _, logs = await process.communicate()
    assert process.returncode == 0
    assert b'"event": "draining"' in logs
