"""docker-compose.yml for real: one chair from upload to the last frame through the gateway; kills and restarts."""

import os
import signal
import struct
import threading
import time
from collections.abc import Callable, Iterator

import httpx
import numpy as np
import pytest
import trimesh
from compose_stack import Stack, engine_answers, engine_scripts, stack
from roam_client import Action, Client, Frame, InvalidRequestError, Placement

SEAT_HEIGHT = 0.45
TAKEN_OVER = 'roam_motion_resumes_total{path="store"}'


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
    upload = httpx.post(f"{running.url}/v1/objects", params={"format": "glb"}, content=chair(), timeout=60)
    assert upload.status_code == 201, upload.text
    name = upload.json()["name"]

    with Client(goalpose=running.address, motion=running.address, timeout=60) as client:
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
    upload = httpx.post(f"{running.url}/v1/objects", params={"format": "glb"}, content=b"no chair", timeout=30)
    assert upload.headers["content-type"].startswith("application/problem+json")
    assert upload.status_code in range(400, 500)
    with Client(goalpose=running.address) as client, pytest.raises(InvalidRequestError) as caught:
        client.upload(b"no chair", format="glb")
    assert caught.value.reason == upload.json()["reason"]


def test_a_browser_can_speak_grpc_web(running: Stack) -> None:
    answer = httpx.post(
        f"{running.url}/roam.v1.ServerService/GetServerInfo",
        content=b"\0" + struct.pack(">I", 0),  # one empty message
        headers={"Content-Type": "application/grpc-web+proto", "Origin": "http://localhost:5173"},
    )
    assert answer.status_code == 200
    assert answer.headers["access-control-allow-origin"] == "http://localhost:5173"
    assert b"goalpose" in answer.content
    assert b"grpc-status:0" in answer.content


def test_all_requests_of_a_session_reach_its_replica(running: Stack) -> None:
    """A request at the wrong replica would be refused, or would move the session and show in the log."""
    with httpx.Client(base_url=f"{running.url}/v1", timeout=10) as http:
        for _ in range(4):
            name = http.post("/sessions", json={}).json()["name"]
            assert [http.get(f"/{name}").status_code for _ in range(8)] == [200] * 8
            lines = http.get(f"/{name}/frames", params={"count": 3, "pacing": "burst"}).text.splitlines()
            assert len(lines) == 4
            assert http.delete(f"/{name}").status_code == 204
    with Client(motion=running.address) as client:
        for _ in range(4):
            with client.create_session() as session:
                assert len({session.steer(0, 0.5) for _ in range(8)}) <= 8
    logs = running.compose("logs", "--no-log-prefix", "motion")
    assert '"event": "claimed"' not in logs


@pytest.mark.parametrize("service", ["gateway", "goalpose", "motion", "redis"])
def test_the_container_is_confined(running: Stack, service: str) -> None:
    for container in running.containers(service):
        state = running.state(container)
        assert state["HostConfig"]["ReadonlyRootfs"]
        assert state["HostConfig"]["CapDrop"] == ["ALL"]
        assert state["HostConfig"]["Memory"] > 0
        assert state["Config"]["User"] not in {"", "0", "root"}
        published = [binding for ports in state["NetworkSettings"]["Ports"].values() for binding in ports or []]
        assert {binding["HostIp"] for binding in published} == ({"127.0.0.1"} if service == "gateway" else set())


class Watch:
    """A REALTIME stream read in a thread, so that a test can break things meanwhile."""

    def __init__(self, running: Stack) -> None:
        self._client = Client(motion=running.address, timeout=30)
        self.session = self._client.create_session(Placement(0, 0, 0.5), seed=3, idle_timeout=120)
        self.frames: list[Frame] = []
        self.times: list[float] = []
        self.error: Exception | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read)

    def __enter__(self) -> "Watch":
        self._thread.start()
        self.wait(10)
        return self

    def __exit__(self, *raised: object) -> None:
        self._stop.set()
        self._thread.join(timeout=30)
        self.session.delete()
        self._client.close()

    def wait(self, count: int) -> None:
        """Until so many more frames have come."""
        wanted, deadline = len(self.frames) + count, time.monotonic() + 60
        while len(self.frames) < wanted:
            assert self.error is None, self.error
            assert time.monotonic() < deadline, f"{len(self.frames)} of {wanted} frames"
            time.sleep(0.02)

    @property
    def longest_gap(self) -> float:
        """Between two frames [s]."""
        return float(np.diff(self.times).max())

    def _read(self) -> None:
        try:
            with self.session.stream(resume_for=60) as stream:
                for frame in stream.frames():
                    self.frames.append(frame)
                    self.times.append(time.monotonic())
                    if self._stop.is_set():
                        return
        except Exception as error:
            self.error = error


def without_interruption(frames: list[Frame]) -> None:
    """What a reader must see whatever broke: frames in order, each once, and a character that does not jump."""
    sequences = [frame.sequence for frame in frames]
    assert sequences == sorted(set(sequences))
    positions = np.array([frame.root_position for frame in frames])
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1) / np.diff(sequences)
    assert steps.max() < 0.15


def crash(running: Stack, container: str) -> None:
    """kill -9 on a container's first process, as a fault would; docker starts it again."""
    try:
        os.kill(running.state(container)["State"]["Pid"], signal.SIGKILL)
    except (PermissionError, ProcessLookupError):
        pytest.skip("only root on the engine's own machine can crash a container's process")


def healthy(running: Stack, container: str) -> None:
    """Waits until a container is healthy (again)."""
    deadline = time.monotonic() + 180
    while running.state(container)["State"].get("Health", {}).get("Status") != "healthy":
        assert time.monotonic() < deadline
        time.sleep(0.5)


def stop(running: Stack, container: str) -> None:
    """SIGTERM, as a deployment does."""
    running.docker("stop", container)
    state = running.state(container)["State"]
    assert state["ExitCode"] == 0, running.docker("logs", "--tail", "40", container)


@pytest.mark.parametrize("end", [crash, stop])
def test_a_stream_survives_the_end_of_its_replica(running: Stack, end: Callable[[Stack, str], None]) -> None:
    with Watch(running) as watch:
        watch.session.steer(0.0, 1.0)
        watch.wait(30)
        owner = running.owner()
        end(running, owner)
        watch.wait(60)
        resumes = [running.metric(name, TAKEN_OVER) for name in running.containers("motion") if name != owner]
        assert sum(resumes) >= 1
        running.up()  # a stopped one is started again, a crashed one starts by itself
        healthy(running, owner)
        watch.wait(60)
        assert watch.session.steer(0.0, 0.0) > 0
        watch.wait(30)
    without_interruption(watch.frames)
    print(f"{end.__name__}: longest gap {watch.longest_gap:.2f} s")


def test_a_stream_survives_a_restart_of_redis(running: Stack) -> None:
    """While Redis is away no replica may move a session; afterwards it goes on, and Redis knows it again."""
    with Watch(running) as watch:
        watch.session.steer(0.0, 1.0)
        watch.wait(30)
        running.compose("restart", "redis")
        watch.wait(90)
        assert watch.session.steer(0.0, 0.0) > 0
    without_interruption(watch.frames)


def test_more_replicas_take_new_sessions(running: Stack) -> None:
    running.up("--scale", "motion=3")
    time.sleep(3)  # the gateway looks names up every second and then asks the new replica for its health
    with Client(motion=running.address) as client:
        sessions = [client.create_session() for _ in range(24)]
        time.sleep(1.5)  # the gauge is set every second
        held = [running.metric(name, "roam_motion_sessions") for name in running.containers("motion")]
        for session in sessions:
            session.delete()
    assert sum(held) == 24
    assert len(held) == 3
    assert min(held) > 0


@pytest.mark.parametrize("service", ["goalpose", "gateway"])
def test_a_crashed_service_is_started_again(running: Stack, service: str) -> None:
    (container,) = running.containers(service)
    before = running.state(container)["State"]["Pid"]
    crash(running, container)
    deadline = time.monotonic() + 120
    while running.state(container)["State"]["Pid"] in {0, before}:
        assert time.monotonic() < deadline
        time.sleep(0.2)
    healthy(running, container)
    deadline = time.monotonic() + 30
    while True:  # the gateway needs a second to see it
        try:
            if httpx.get(f"{running.url}/readyz", timeout=10).status_code == 200:
                return
        except httpx.TransportError:
            pass
        assert time.monotonic() < deadline
        time.sleep(0.2)
