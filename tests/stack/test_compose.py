"""docker-compose.yml for real: images built, both services healthy, one chair from upload to the last frame."""

import json
import os
import signal
import time
from collections.abc import Iterator

import httpx
import numpy as np
import pytest
import trimesh
from compose_stack import Stack, engine_answers, engine_scripts, stack
from roam_client import Action, Client, InvalidRequestError, Placement

SEAT_HEIGHT = 0.45


def why_not() -> str:
    if os.environ.get("ROAM_TEST_COMPOSE") != "1":
        return "builds container images, minutes of work: set ROAM_TEST_COMPOSE=1"
    if engine_scripts() is None and not engine_answers():
        return "no docker with compose here, and no engine scripts to start one with (they need root on Debian)"
    return ""


pytestmark = [pytest.mark.skipif(bool(why_not()), reason=why_not()), pytest.mark.timeout(2700)]


@pytest.fixture(scope="module")
def running() -> Iterator[Stack]:
    with stack() as services:
        yield services


def chair() -> bytes:
    """A plain wooden chair, seat at 0.45 m, facing +Z."""
    parts = [trimesh.creation.box([0.46, 0.04, 0.46], trimesh.transformations.translation_matrix([0, 0.43, 0]))]
    parts += [
        trimesh.creation.box([0.04, 0.41, 0.04], trimesh.transformations.translation_matrix([x, 0.205, z]))
        for x in (-0.2, 0.2)
        for z in (-0.2, 0.2)
    ]
    parts += [trimesh.creation.box([0.46, 0.5, 0.04], trimesh.transformations.translation_matrix([0, 0.7, -0.21]))]
    return trimesh.util.concatenate(parts).export(file_type="glb")


def test_a_character_walks_to_an_uploaded_chair_and_sits(running: Stack) -> None:
    upload = httpx.post(f"{running.http('goalpose')}/v1/objects", params={"format": "glb"}, content=chair(), timeout=60)
    assert upload.status_code in {200, 201}, upload.text
    name = upload.json()["name"]

    with Client(goalpose=running.grpc("goalpose"), motion=running.grpc("motion")) as client:
        goal = client.synthesize(name, reference="chair_sit")
        hips_above_seat = goal.root_position[1] - SEAT_HEIGHT
        assert 0.0 < hips_above_seat < 0.25

        start = Placement(x=0.0, z=2.5, yaw=np.pi)
        with client.create_session(start, floor_height=goal.floor_height) as session:
            motion = session.bake(goal, max_frames=450)

    assert motion.frame_count > 30
    distances = motion.goal_distances()
    assert distances[0] > 1.0
    assert np.nanmin(distances) < 0.15
    assert motion.action_at(motion.frame_count - 1) is Action.SIT


def test_errors_cross_both_doors_with_the_same_reason(running: Stack) -> None:
    upload = httpx.post(f"{running.http('goalpose')}/v1/objects", params={"format": "glb"}, content=b"no chair")
    assert upload.headers["content-type"].startswith("application/problem+json")
    assert upload.status_code in range(400, 500)
    with Client(goalpose=running.grpc("goalpose")) as client, pytest.raises(InvalidRequestError) as caught:
        client.upload(b"no chair", format="glb")
    assert caught.value.reason == upload.json()["reason"]


@pytest.mark.parametrize("service", ["goalpose", "motion"])
def test_the_container_is_confined(running: Stack, service: str) -> None:
    inspected = json.loads(running.docker("inspect", running.container(service)))[0]
    assert inspected["HostConfig"]["ReadonlyRootfs"]
    assert inspected["HostConfig"]["Memory"] > 0
    assert inspected["Config"]["User"] == "roam"
    published = [binding for bindings in inspected["NetworkSettings"]["Ports"].values() for binding in bindings]
    assert {binding["HostIp"] for binding in published} == {"127.0.0.1"}


@pytest.mark.parametrize("service", ["goalpose", "motion"])
def test_a_service_stops_cleanly(running: Stack, service: str) -> None:
    container = running.container(service)
    running.compose("stop", service)
    state = json.loads(running.docker("inspect", container))[0]["State"]
    assert state["ExitCode"] == 0, running.compose("logs", "--tail", "40", service)
    running.compose("up", "--detach", "--wait", service, seconds=240)


def test_a_crashed_service_is_started_again(running: Stack) -> None:
    container = running.container("motion")
    crashed = json.loads(running.docker("inspect", container))[0]["State"]["Pid"]
    try:
        os.kill(crashed, signal.SIGKILL)
    except (PermissionError, ProcessLookupError):
        pytest.skip("only root on the engine's own machine can crash a container's process")
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        state = json.loads(running.docker("inspect", container))[0]["State"]
        if state["Pid"] not in {0, crashed} and state["Health"]["Status"] == "healthy":
            break
        time.sleep(0.5)
    else:
        raise AssertionError(f"not healthy again: {state}")
    assert httpx.get(f"{running.http('motion')}/readyz", timeout=10).status_code == 200
