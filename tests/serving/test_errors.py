"""One error table, two transports: the same reason, field and remedy on both."""

import grpc
import httpx
import pytest
from echo import KINDS, Echo
from google.rpc import error_details_pb2
from grpc_status import rpc_status
from roam_serving.errors import COMMON, ErrorKind, by_reason, table_markdown
from roam_serving.server import running
from roam_serving.settings import ServerSettings
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed


@pytest.fixture
async def addresses():
    async with running([Echo()], ServerSettings()) as addresses:
        yield addresses


def details(error: grpc.aio.AioRpcError) -> dict:
    """The rich status of a gRPC error by detail type."""
    status = rpc_status.from_call(error)
    found = {"code": status.code, "message": status.message}
    for packed in status.details:
        kind = packed.TypeName().rpartition(".")[2]
        message = getattr(error_details_pb2, kind)()
        packed.Unpack(message)
        found[kind] = message
    return found


async def grpc_failure(address: str, method: str, reason: str) -> grpc.aio.AioRpcError:
    async def call() -> None:
        path = f"/echo.Echo/{method}"
        if method == "Fail":
            await channel.unary_unary(path)(reason.encode())
        async for _ in channel.unary_stream(path)(reason.encode()):
            pass

    async with grpc.aio.insecure_channel(address) as channel:
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await call()
    return caught.value


@pytest.mark.parametrize("method", ["Fail", "FailLater"])
async def test_every_row_reads_alike_on_both_transports(addresses, method):
    async with httpx.AsyncClient(base_url=addresses.http) as client:
        for kind in COMMON:
            response = await client.get(f"/fail/{kind.reason}")
            error = await grpc_failure(addresses.grpc, method, kind.reason)
            problem, rich = response.json(), details(error)
            assert response.status_code == problem["status"] == kind.http_status
            assert response.headers["content-type"] == "application/problem+json"
            assert error.code() == kind.grpc_code
            info = rich["ErrorInfo"]
            assert problem["reason"] == info.reason == kind.reason
            assert problem["remedy"] == info.metadata["remedy"] == kind.remedy
            assert problem["title"] == info.metadata["title"] == kind.title
            assert problem["detail"] == rich["message"] == "what happened"
            assert problem["errors"][0]["field"] == rich["BadRequest"].field_violations[0].field == "some.field"
            assert problem["retry_after"] == 1.5
            assert rich["RetryInfo"].retry_delay.ToMilliseconds() == 1500
            assert response.headers["retry-after"] == "2"


async def test_a_bug_is_internal_and_tells_no_secrets(addresses):
    async with httpx.AsyncClient(base_url=addresses.http) as client:
        response = await client.get("/fail/BUG", headers={"X-Request-Id": "mine"})
    rich = details(await grpc_failure(addresses.grpc, "Fail", "BUG"))
    assert response.status_code == 500
    assert response.json()["reason"] == rich["ErrorInfo"].reason == "INTERNAL"
    assert response.json()["instance"] == "urn:roam:request:mine"
    assert "secret" not in response.text + rich["message"]


@pytest.mark.parametrize(
    ("request_arguments", "status", "reason"),
    [
        (("GET", "/nowhere"), 404, "ROUTE_NOT_FOUND"),
        (("GET", "/number"), 405, "METHOD_NOT_ALLOWED"),
        (("POST", "/number", {"json": {"number": "x"}}), 400, "INVALID_ARGUMENT"),
        (
            ("POST", "/number", {"content": b"{", "headers": {"content-type": "application/json"}}),
            400,
            "INVALID_ARGUMENT",
        ),
    ],
)
async def test_what_the_framework_refuses_is_a_problem_too(addresses, request_arguments, status, reason):
    method, path, *rest = request_arguments
    async with httpx.AsyncClient(base_url=addresses.http) as client:
        response = await client.request(method, path, **(rest[0] if rest else {}))
    assert response.status_code == status
    assert response.headers["content-type"] == "application/problem+json"
    assert response.json()["reason"] == reason


async def test_an_invalid_field_is_named(addresses):
    async with httpx.AsyncClient(base_url=addresses.http) as client:
        response = await client.post("/number", json={"number": "x"})
    assert response.json()["errors"][0]["field"] == "number"


async def test_large_bodies_are_refused_announced_or_not():
    async def pieces():
        for _ in range(5):
            yield b"x" * 400

    async with (
        running([Echo()], ServerSettings(max_upload_bytes=1000)) as addresses,
        httpx.AsyncClient(base_url=addresses.http) as client,
    ):
        assert (await client.post("/size", content=b"x" * 1000)).json() == 1000
        for body in (b"x" * 1001, pieces()):
            response = await client.post("/size", content=body)
            assert response.status_code == 413
            assert response.json()["reason"] == "PAYLOAD_TOO_LARGE"


async def test_every_row_closes_a_websocket_with_its_status_and_reason(addresses):
    for kind in COMMON:
        async with connect(f"{addresses.http.replace('http', 'ws')}/fail/{kind.reason}") as socket:
            with pytest.raises(ConnectionClosed) as caught:
                await socket.recv()
        assert (caught.value.rcvd.code, caught.value.rcvd.reason) == (4000 + kind.http_status, kind.reason)


def test_two_rows_cannot_share_a_reason():
    twin = ErrorKind("INTERNAL", grpc.StatusCode.ABORTED, 400, "t", "r")
    with pytest.raises(ValueError, match="INTERNAL"):
        by_reason([*COMMON, twin])


def test_the_markdown_table_has_every_row():
    text = table_markdown([("Common", COMMON)])
    for kind in KINDS.values():
        assert f"| `{kind.reason}` | {kind.grpc_code.name} | {kind.http_status} |" in text


async def undecodable(address: str, kind: str) -> None:
    async with grpc.aio.insecure_channel(address) as channel:
        if kind == "unary":
            await channel.unary_unary("/roam.v1.ServerService/GetServerInfo")(b"\xff\xff\xff")
        else:
            call = channel.stream_stream("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo")()
            await call.write(b"\xff\xff\xff")
            await call.read()


@pytest.mark.parametrize("kind", ["unary", "stream"])
async def test_bytes_that_are_no_message_are_an_invalid_argument(addresses, kind):
    """Alone, gRPC answers UNKNOWN and says nothing of a reason."""
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await undecodable(addresses.grpc, kind)
    assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert details(caught.value)["ErrorInfo"].reason == "INVALID_ARGUMENT"
