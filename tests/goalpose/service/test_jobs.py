"""`Prefer: respond-async`, jobs and idempotency keys, as curl sees them."""

import asyncio
import threading

import httpx
import pytest
from poser import box_file

ASYNC = {"Prefer": "respond-async"}


@pytest.fixture
async def client(goalpose_addresses):
    async with httpx.AsyncClient(base_url=goalpose_addresses.http, timeout=30) as client:
        yield client


@pytest.fixture
async def body(client):
    uploaded = await client.post("/v1/objects", content=box_file(), params={"format": "glb"})
    return {"object": uploaded.json()["name"], "action": "sit"}


async def finished(client, location):
    """The job when it no longer runs."""
    while (job := (await client.get(location)).json())["state"] == "running":
        await asyncio.sleep(0.01)
    return job


async def test_a_job_answers_at_once_and_has_the_pose_later(client, body, poser):
    poser.gate = threading.Event()
    started = await client.post("/v1/goal-poses", json=body, headers=ASYNC)
    assert started.status_code == 202
    location = started.headers["location"]
    assert location == f"/v1/{started.json()['name']}"
    while not (running := await client.get(location)).json()["progress"]:
        await asyncio.sleep(0.01)
    assert running.json()["state"] == "running"
    assert running.json()["progress"]["stage_name"] == "preparing"
    assert running.headers["retry-after"] == "1"
    poser.gate.set()
    job = await finished(client, location)
    plain = await client.post("/v1/goal-poses", json=body)
    assert job["state"] == "succeeded"
    assert job["goal_pose"] == plain.json()
    assert plain.headers["x-roam-cache"] == "hit"
    assert len(poser.runs) == 1


async def test_what_is_known_already_needs_no_job(client, body):
    plain = await client.post("/v1/goal-poses", json=body)
    again = await client.post("/v1/goal-poses", json=body, headers=ASYNC)
    assert (again.status_code, again.json()) == (200, plain.json())


async def test_a_deleted_job_stops_and_is_forgotten(client, body, poser):
    poser.gate = threading.Event()
    location = (await client.post("/v1/goal-poses", json=body, headers=ASYNC)).headers["location"]
    while not poser.runs:
        await asyncio.sleep(0.005)
    assert (await client.delete(location)).status_code == 204
    assert await asyncio.to_thread(poser.stopped.wait, 10)
    gone = await client.get(location)
    assert (gone.status_code, gone.json()["reason"]) == (404, "JOB_NOT_FOUND")
    assert (await client.delete(location)).status_code == 404


async def test_a_failed_job_tells_the_problem(client, body, poser, monkeypatch):
    def fail(*arguments, **keywords):
        raise ZeroDivisionError("a secret")

    monkeypatch.setattr(poser, "synthesize", fail)
    location = (await client.post("/v1/goal-poses", json=body, headers=ASYNC)).headers["location"]
    job = await finished(client, location)
    assert (job["state"], job["error"]["reason"]) == ("failed", "INTERNAL")
    assert "secret" not in str(job)


async def test_a_full_queue_refuses_jobs_at_once(client, body, poser):
    poser.gate = threading.Event()
    jobs = [await client.post("/v1/goal-poses", json=body | {"seed": seed}, headers=ASYNC) for seed in (1, 2)]
    while "roam_synthesis_queue_depth 2.0" not in (await client.get("/metrics")).text:
        await asyncio.sleep(0.01)
    refused = await client.post("/v1/goal-poses", json=body | {"seed": 3}, headers=ASYNC)
    assert (refused.status_code, refused.json()["reason"]) == (429, "QUEUE_FULL")
    poser.gate.set()
    for job in jobs:
        assert (await finished(client, job.headers["location"]))["state"] == "succeeded"


async def test_an_idempotency_key_makes_sending_again_safe(client, body):
    headers = ASYNC | {"Idempotency-Key": "order-1"}
    first = await client.post("/v1/goal-poses", json=body | {"seed": 1}, headers=headers)
    job = await finished(client, first.headers["location"])
    assert job["state"] == "succeeded"
    again = await client.post("/v1/goal-poses", json=body | {"seed": 1}, headers=headers)
    assert again.json() == job["goal_pose"]  # from the cache
    other = await client.post("/v1/goal-poses", json=body | {"seed": 2}, headers=headers)
    assert (other.status_code, other.json()["reason"]) == (409, "IDEMPOTENCY_KEY_REUSED")
    plain = await client.post("/v1/goal-poses", json=body | {"seed": 2}, headers={"Idempotency-Key": "order-1"})
    assert plain.status_code == 409


async def test_the_same_key_while_the_job_runs_is_the_same_job(client, body, poser):
    poser.gate = threading.Event()
    headers = ASYNC | {"Idempotency-Key": "order-2"}
    first, second = [await client.post("/v1/goal-poses", json=body, headers=headers) for _ in range(2)]
    assert first.json()["name"] == second.json()["name"]
    other = await client.post("/v1/goal-poses", json=body, headers=ASYNC)
    assert other.json()["name"] != first.json()["name"]
    poser.gate.set()
    for job in (first, other):
        assert (await finished(client, job.headers["location"]))["state"] == "succeeded"
    assert len(poser.runs) == 1
