"""What one API key has uploaded or started is not there for another; without keys all callers share."""

import asyncio
import threading

import grpc
import httpx
import pytest
from poser import box_file
from roam.v1 import goal_pose_pb2, goal_pose_pb2_grpc
from roam_goalpose.app import GoalPoseService
from roam_goalpose.settings import GoalPoseSettings
from roam_goalpose.synthesis import Synthesizer
from roam_serving.keys import add_key
from roam_serving.server import running

KEEPS = 4  # objects


@pytest.fixture
async def keyed(monkeypatch, poser, tmp_path):
    """A server's addresses, and the headers of two keys."""
    monkeypatch.setattr(Synthesizer, "load", classmethod(lambda cls, settings: poser))
    keys = [add_key(tmp_path / "keys", name) for name in ("studio", "stranger")]
    settings = GoalPoseSettings(api_keys=str(tmp_path / "keys"), isolate_uploads=False, object_cache=KEEPS)
    async with running([GoalPoseService(settings)], settings) as addresses:
        yield addresses, [{"Authorization": f"Bearer {key}"} for key in keys]


@pytest.fixture
async def http(keyed):
    addresses, (mine, theirs) = keyed
    async with (
        httpx.AsyncClient(base_url=addresses.http, headers=mine, timeout=30) as owner,
        httpx.AsyncClient(base_url=addresses.http, headers=theirs, timeout=30) as stranger,
    ):
        yield owner, stranger


async def uploaded(client, size=0.5):
    answer = await client.post("/v1/objects", content=box_file(size), params={"format": "glb"})
    assert answer.status_code == 201, answer.text
    return answer.json()["name"]


def refused(answer):
    return answer.status_code, answer.json()["reason"]


async def test_an_object_is_there_for_its_key_only(http):
    owner, stranger = http
    name = await uploaded(owner)
    assert (await owner.get(f"/v1/{name}")).status_code == 200
    assert refused(await stranger.get(f"/v1/{name}")) == (404, "OBJECT_NOT_FOUND")
    body = {"object": name, "action": "sit"}
    assert (await owner.post("/v1/goal-poses", json=body)).status_code == 200
    # the answer is in the cache by now; whoever does not have the object does not get it either
    assert refused(await stranger.post("/v1/goal-poses", json=body)) == (404, "OBJECT_NOT_FOUND")
    assert await uploaded(stranger) == name
    assert (await stranger.post("/v1/goal-poses", json=body)).headers["x-roam-cache"] == "hit"


async def test_over_grpc_too(keyed):
    addresses, headers = keyed
    mine, theirs = ((("authorization", one["Authorization"]),) for one in headers)
    async with grpc.aio.insecure_channel(addresses.grpc) as channel:
        stub = goal_pose_pb2_grpc.GoalPoseServiceStub(channel)
        upload = iter([goal_pose_pb2.UploadObjectRequest(format="glb", chunk=box_file())])
        name = (await stub.UploadObject(upload, metadata=mine)).object.name
        asked = goal_pose_pb2.GetObjectRequest(name=name)
        assert (await stub.GetObject(asked, metadata=mine)).object.name == name
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await stub.GetObject(asked, metadata=theirs)
        assert caught.value.code() is grpc.StatusCode.NOT_FOUND
        pose = goal_pose_pb2.SynthesizeRequest(object=name, reference_pose="referencePoses/chair_sit")
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            [message async for message in stub.Synthesize(pose, metadata=theirs)]
        assert caught.value.code() is grpc.StatusCode.NOT_FOUND


async def test_a_job_is_there_for_its_key_only(http, poser):
    owner, stranger = http
    body = {"object": await uploaded(owner), "action": "sit"}
    poser.gate = threading.Event()
    started = await owner.post("/v1/goal-poses", json=body, headers={"Prefer": "respond-async"})
    location = started.headers["location"]
    assert refused(await stranger.get(location)) == (404, "JOB_NOT_FOUND")
    assert refused(await stranger.delete(location)) == (404, "JOB_NOT_FOUND")
    poser.gate.set()
    while (job := (await owner.get(location)).json())["state"] == "running":
        await asyncio.sleep(0.01)
    assert job["state"] == "succeeded"


async def test_two_keys_may_use_the_same_idempotency_key(http):
    owner, stranger = http
    answers = []
    for client, size in ((owner, 0.5), (stranger, 0.6)):
        body = {"object": await uploaded(client, size), "action": "sit"}
        headers = {"Prefer": "respond-async", "Idempotency-Key": "once"}
        answers.append(await client.post("/v1/goal-poses", json=body, headers=headers))
    assert [answer.status_code for answer in answers] == [202, 202]
    assert answers[0].json()["name"] != answers[1].json()["name"]


async def test_a_key_that_uploads_much_pushes_out_its_own_objects_only(http):
    owner, stranger = http
    name = await uploaded(owner)
    theirs = [await uploaded(stranger, 0.3 + 0.05 * number) for number in range(2 * KEEPS)]
    assert (await owner.get(f"/v1/{name}")).status_code == 200
    assert (await stranger.get(f"/v1/{theirs[0]}")).status_code == 404
    assert (await stranger.get(f"/v1/{theirs[-1]}")).status_code == 200


async def test_without_keys_all_callers_share(goalpose_addresses):
    async with httpx.AsyncClient(base_url=goalpose_addresses.http, timeout=30) as client:
        name = await uploaded(client)
    async with httpx.AsyncClient(base_url=goalpose_addresses.http, timeout=30) as other:
        assert (await other.get(f"/v1/{name}")).status_code == 200
