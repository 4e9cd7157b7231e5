"""API keys and rates over real connections: HTTP, WebSocket and gRPC refuse alike."""

import json
import logging
import subprocess
import sys

import grpc
import httpx
import pytest
from echo import Echo
from google.rpc import error_details_pb2
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_status import rpc_status
from roam.v1 import server_pb2, server_pb2_grpc
from roam_serving.errors import RATE_LIMITED, ServiceError
from roam_serving.keys import KeyRing, add_key, key_hash
from roam_serving.rates import RateLimiter
from roam_serving.server import running
from roam_serving.settings import ServerSettings, SettingsError
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed


@pytest.fixture
def key_file(tmp_path):
    return tmp_path / "keys"


@pytest.fixture
def key(key_file):
    return add_key(key_file, "studio")


@pytest.fixture
async def addresses(key_file, key):
    async with running([Echo()], ServerSettings(api_keys=str(key_file))) as addresses:
        yield addresses


async def ask_grpc(address, key=None):
    """The services' names, or the reason of the refusal."""
    metadata = None if key is None else (("authorization", f"Bearer {key}"),)
    async with grpc.aio.insecure_channel(address) as channel:
        stub = server_pb2_grpc.ServerServiceStub(channel)
        try:
            return list((await stub.GetServerInfo(server_pb2.GetServerInfoRequest(), metadata=metadata)).services)
        except grpc.aio.AioRpcError as error:
            info = error_details_pb2.ErrorInfo()
            rpc_status.from_call(error).details[0].Unpack(info)
            return info.reason


async def ask_websocket(address, **keywords):
    """What is said first, or the reason of the refusal."""
    async with connect(f"{address.replace('http', 'ws')}/words", **keywords) as socket:
        try:
            return await socket.recv()
        except ConnectionClosed as closed:
            return closed.rcvd.reason if closed.rcvd else ""


@pytest.mark.parametrize(("wrong", "reason"), [(None, "API_KEY_MISSING"), ("roam_guess", "API_KEY_UNKNOWN")])
async def test_no_key_and_a_wrong_key_are_told_apart_on_every_transport(addresses, wrong, reason):
    headers = {} if wrong is None else {"Authorization": f"Bearer {wrong}"}
    async with httpx.AsyncClient(base_url=addresses.http) as client:
        response = await client.get("/v1/server", headers=headers)
    assert (response.status_code, response.json()["reason"]) == (401, reason)
    assert response.headers["www-authenticate"] == "Bearer"
    assert await ask_grpc(addresses.grpc, wrong) == reason
    assert await ask_websocket(addresses.http, additional_headers=headers) == reason


async def test_the_right_key_opens_every_transport(addresses, key):
    headers = {"Authorization": f"bearer {key}"}
    async with httpx.AsyncClient(base_url=addresses.http) as client:
        assert (await client.get("/v1/server", headers=headers)).json()["services"] == ["echo"]
    assert await ask_grpc(addresses.grpc, key) == ["echo"]
    assert await ask_websocket(addresses.http, additional_headers=headers) == "hello"


async def test_a_browser_gives_the_key_as_a_subprotocol(addresses, key):
    async with connect(
        f"{addresses.http.replace('http', 'ws')}/words", subprotocols=["roam.v1", f"roam.key.{key}"]
    ) as socket:
        assert socket.subprotocol == "roam.v1"
        assert await socket.recv() == "hello"


async def test_health_and_documentation_need_no_key(addresses):
    async with httpx.AsyncClient(base_url=addresses.http) as client:
        for path in ("/livez", "/readyz", "/docs", "/openapi.json"):
            assert (await client.get(path)).status_code == 200
        assert (await client.get("/metrics")).status_code == 401
        origin = {"Origin": "http://localhost:5173", "Access-Control-Request-Method": "POST"}
        assert (await client.options("/number", headers=origin)).status_code == 200
        refused = await client.post("/number", json={"number": 1}, headers={"Origin": "http://localhost:5173"})
        # Without this header the page could not read why it was refused.
        assert refused.headers["access-control-allow-origin"] == "http://localhost:5173"
    async with grpc.aio.insecure_channel(addresses.grpc) as channel:
        await health_pb2_grpc.HealthStub(channel).Check(health_pb2.HealthCheckRequest())


async def test_the_log_names_the_caller_and_never_the_key(addresses, key, caplog):
    with caplog.at_level(logging.INFO, "serving.http"):
        async with httpx.AsyncClient(base_url=addresses.http) as client:
            await client.get("/v1/server", headers={"Authorization": f"Bearer {key}"})
    line = next(record.msg for record in caplog.records if record.name == "serving.http")
    assert line["caller"] == "studio"
    assert key not in str(line)


async def test_the_rate_counts_for_every_key_alone_and_says_when_to_come_back(key_file, key):
    other = add_key(key_file, "other")
    settings = ServerSettings(api_keys=str(key_file), requests_per_second=0.01, request_burst=2)
    async with running([Echo()], settings) as addresses, httpx.AsyncClient(base_url=addresses.http) as client:
        headers = {"Authorization": f"Bearer {key}"}
        answers = [await client.get("/v1/server", headers=headers) for _ in range(3)]
        assert [answer.status_code for answer in answers] == [200, 200, 429]
        assert answers[2].json()["reason"] == "RATE_LIMITED"
        assert 90 <= int(answers[2].headers["retry-after"]) <= 100
        assert await ask_grpc(addresses.grpc, key) == "RATE_LIMITED"
        assert await ask_grpc(addresses.grpc, other) == ["echo"]


async def test_without_keys_the_rate_counts_for_an_address():
    settings = ServerSettings(requests_per_second=0.01, request_burst=1)
    async with running([Echo()], settings) as addresses, httpx.AsyncClient(base_url=addresses.http) as client:
        assert [(await client.get("/v1/server")).status_code for _ in range(2)] == [200, 429]


def test_a_bucket_fills_again():
    now = 0.0
    limiter = RateLimiter(2.0, 3, clock=lambda: now)
    for _ in range(3):
        limiter.take("a")
    with pytest.raises(ServiceError) as caught:
        limiter.take("a")
    assert caught.value.kind is RATE_LIMITED
    assert caught.value.retry_after == 0.5
    now = 0.5
    limiter.take("a")
    now = 100.0
    for _ in range(3):
        limiter.take("a")
    with pytest.raises(ServiceError):
        limiter.take("a")


def test_the_file_keeps_hashes_only(key_file):
    command = [sys.executable, "-m", "roam_serving.keys", "game-1", "--file", str(key_file)]
    key = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout.strip()
    text = key_file.read_text()
    assert text == f"game-1 {key_hash(key)}\n"
    assert key not in text
    assert key_file.stat().st_mode & 0o077 == 0
    key_file.write_text(f"# keys\n\n{text}")
    assert KeyRing.read(key_file).name_of(key) == "game-1"
    assert KeyRing.read(key_file).name_of(key + "x") is None


@pytest.mark.parametrize(("text", "words"), [("studio secret\n", "line 1"), ("# nothing\n", "has no key")])
def test_a_file_that_is_not_one_stops_the_start(key_file, text, words):
    key_file.write_text(text)
    with pytest.raises(SettingsError, match=words):
        KeyRing.read(key_file)


def test_a_server_that_cannot_read_its_keys_ends_with_a_sentence(tmp_path):
    program = (
        f"import sys; sys.path.insert(0, {json.dumps(str(next(p for p in sys.path if p.endswith('serving'))))}); "
        "from echo import Echo; from roam_serving.server import serve; "
        "from roam_serving.settings import ServerSettings; "
        f"serve([Echo()], ServerSettings(api_keys={json.dumps(str(tmp_path / 'none'))}))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2
    assert "No such file" in done.stderr
    assert "Traceback" not in done.stderr
