"""Hostile files at a real server with its real reader process: the same refusal on HTTP and gRPC, and it lives on."""

import gc
from collections.abc import AsyncIterator
from typing import Any

import grpc
import httpx
import psutil
import pytest
from google.rpc import error_details_pb2
from grpc_status import rpc_status
from hostile_files import HOSTILE
from poser import Poser, box_file
from roam.v1 import goal_pose_pb2, goal_pose_pb2_grpc
from roam_goalpose.app import GoalPoseService
from roam_goalpose.errors import OBJECT_ERRORS
from roam_goalpose.settings import GoalPoseSettings
from roam_goalpose.synthesis import Synthesizer
from roam_serving.errors import COMMON, by_reason
from roam_serving.server import Addresses, running

TABLE = by_reason([*COMMON, *OBJECT_ERRORS])
MOST_GROWTH = 150 << 20  # bytes, of server and reader together over all files; libraries load, heaps settle


@pytest.fixture(scope="module")
def poser() -> Poser:
    return Poser()


@pytest.fixture
async def addresses(monkeypatch: pytest.MonkeyPatch, poser: Poser) -> AsyncIterator[Addresses]:
    monkeypatch.setattr(Synthesizer, "load", classmethod(lambda cls, settings: poser))
    settings = GoalPoseSettings()
    async with running([GoalPoseService(settings)], settings) as addresses:
        yield addresses


async def over_http(client: httpx.AsyncClient, format: str, data: bytes) -> dict[str, Any]:
    answer = await client.post("/v1/objects", params={"format": format}, content=data)
    assert answer.status_code in range(400, 500), answer.text
    return answer.json()


async def over_grpc(
    stub: goal_pose_pb2_grpc.GoalPoseServiceStub, format: str, data: bytes
) -> tuple[str, grpc.StatusCode]:
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await stub.UploadObject(iter([goal_pose_pb2.UploadObjectRequest(format=format, chunk=data)]))
    info = error_details_pb2.ErrorInfo()
    rpc_status.from_call(caught.value).details[0].Unpack(info)
    return info.reason, caught.value.code()


def memory() -> int:
    """Resident bytes of this process and its children."""
    gc.collect()
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    return sum(process.memory_info().rss for process in processes)


async def test_every_hostile_file_is_refused_alike_on_both_transports(addresses: Addresses) -> None:
    async with (
        httpx.AsyncClient(base_url=addresses.http, timeout=60) as client,
        grpc.aio.insecure_channel(addresses.grpc) as channel,
    ):
        stub = goal_pose_pb2_grpc.GoalPoseServiceStub(channel)
        good = {"params": {"format": "glb"}, "content": box_file()}
        assert (await client.post("/v1/objects", **good)).status_code == 201
        before = memory()
        for name, (format, data) in HOSTILE.items():
            problem = await over_http(client, format, data)
            row = TABLE[problem["reason"]]
            assert problem["reason"] not in {"INTERNAL", "OBJECT_READER_FAILED"}, name
            assert problem["status"] == row.http_status, name
            assert problem["remedy"], name
            assert await over_grpc(stub, format, data) == (row.reason, row.grpc_code), name
            assert ".py" not in problem["detail"], name  # nothing of the server's inside
        assert memory() - before < MOST_GROWTH
        assert (await client.post("/v1/objects", **good)).status_code == 201
        told = (await client.get("/metrics")).text
    assert "roam_goalpose_uploads_rejected_total{" in told


@pytest.mark.parametrize("name", ["glTF buffer at chair.bin", "glTF buffer at file:///etc/passwd"])
async def test_other_files_are_never_opened(addresses: Addresses, name: str) -> None:
    async with httpx.AsyncClient(base_url=addresses.http, timeout=60) as client:
        assert (await over_http(client, *HOSTILE[name]))["reason"] == "OBJECT_EXTERNAL_FILE"


@pytest.mark.parametrize("body", [b"[" * 200_000, b'{"object":' * 50_000, b'{"points":' + b"[" * 100_000])
async def test_deep_json_in_a_request_is_a_bad_request(addresses: Addresses, body: bytes) -> None:
    async with httpx.AsyncClient(base_url=addresses.http, timeout=60) as client:
        headers = {"Content-Type": "application/json"}
        answer = await client.post("/v1/goal-poses", content=body, headers=headers)
        assert (answer.status_code, answer.json()["reason"]) == (400, "INVALID_ARGUMENT")
        assert (await client.get("/readyz")).status_code == 200
