"""The motion service over plain HTTP: what curl sees."""

import json

import httpx
import pytest


@pytest.fixture
async def client(motion_addresses):
    async with httpx.AsyncClient(base_url=motion_addresses.http) as client:
        yield client


async def create(client, **body):
    response = await client.post("/v1/sessions", json=body)
    assert response.status_code == 201
    return response.json()


async def lines(client, session, **params):
    """The whole NDJSON answer, line by line."""
    async with client.stream("GET", f"/v1/sessions/{session['id']}/frames", params=params) as response:
        assert response.status_code == 200
        assert response.headers["content-type"] == "application/x-ndjson"
        return [json.loads(line) async for line in response.aiter_lines()]


async def test_life_of_a_session(client):
    bare = (await client.post("/v1/sessions")).json()
    session = await create(client, request_id="a", start={"x": 1.0, "z": 2.0, "yaw": 0.5}, idle_timeout=5)
    assert (await create(client, request_id="a"))["name"] == session["name"]
    assert session["expire_time"] - session["create_time"] == pytest.approx(5, abs=0.5)
    listed = (await client.get("/v1/sessions")).json()
    assert [item["id"] for item in listed["sessions"]] == [bare["id"], session["id"]]
    page = (await client.get("/v1/sessions", params={"page_size": 1})).json()
    assert page["next_page_token"]
    assert (await client.get(f"/v1/sessions/{session['id']}")).json()["name"] == session["name"]
    assert (await client.delete(f"/v1/sessions/{session['id']}")).status_code == 204
    gone = await client.get(f"/v1/sessions/{session['id']}")
    assert gone.status_code == 404
    assert gone.json()["reason"] == "SESSION_NOT_FOUND"


async def test_frames_as_json_lines(client):
    session = await create(client)
    header, *frames = await lines(client, session, pacing="burst", count=3, positions=True)
    assert header["type"] == "header"
    assert header["first_sequence"] == 1
    assert [frame["sequence"] for frame in frames] == [1, 2, 3]
    skeleton = (await client.get(f"/v1/skeletons/{header['skeleton_id']}")).json()
    joints = len(skeleton["joint_names"])
    assert [len(frames[0][name]) for name in ("rotations", "joint_positions", "contacts")] == [joints, joints, 4]
    assert frames[0]["goal_distance"] is None
    again = await lines(client, session, pacing="burst", count=2, after_sequence=1)
    assert again[1]["sequence"] == 2
    assert again[1]["rotations"] == frames[1]["rotations"]
    assert "joint_positions" not in again[1]


async def test_frames_as_server_sent_events(client):
    session = await create(client)
    address = f"/v1/sessions/{session['id']}/frames"
    headers = {"Accept": "text/event-stream"}
    response = await client.get(address, params={"pacing": "burst", "count": 2}, headers=headers)
    assert response.headers["content-type"].startswith("text/event-stream")
    assert [line for line in response.text.splitlines() if line.startswith(("event", "id"))] == [
        "event: header",
        "id: 1",
        "event: frame",
        "id: 2",
        "event: frame",
    ]
    headers["Last-Event-ID"] = "2"
    response = await client.get(address, params={"pacing": "burst", "count": 1}, headers=headers)
    assert "id: 3" in response.text.splitlines()


async def test_control_by_hand_and_by_goal(client):
    session = await create(client)
    address = f"/v1/sessions/{session['id']}/control"
    answer = await client.post(address, json={"steer": {"velocity": [1.0, 0.0]}})
    assert answer.json() == {"effective_sequence": 1}
    found = await lines(client, session, pacing="burst", count=5)
    walking = [item for item in found if item["type"] == "frame"]
    assert walking[-1]["root_position"][0] > walking[0]["root_position"][0]
    skeleton = (await client.get("/v1/skeletons/default")).json()
    pose = {"root_position": [3.0, 0.9, 0.0], "rotations": skeleton["rest_rotations"]}
    answer = await client.post(address, json={"goal": {"pose": pose, "action": "sit", "goal_pose": "mine"}})
    assert answer.json()["effective_sequence"] > 5
    last = (
        await lines(client, session, pacing="burst", count=3, after_sequence=answer.json()["effective_sequence"] - 1)
    )[-1]
    assert last["goal_distance"] is not None


@pytest.mark.parametrize(
    ("path", "body", "field"),
    [
        ("/v1/sessions", {"start": {"x": "far"}}, "start.x"),
        ("/v1/sessions", {"idle_timeout": 1e8}, "idle_timeout"),
        ("/v1/sessions", {"idle_timeout": 1.7e308}, "idle_timeout"),
        ("/v1/sessions", {"unknown": 1}, "unknown"),
        ("control", {}, "control.input"),
        ("control", {"steer": {"velocity": [1.0]}}, "steer.velocity"),
        ("control", {"goal": {"pose": {"root_position": [0, 0, 0], "rotations": [[0, 0, 0, 1]]}}}, "control.goal.pose"),
    ],
)
async def test_a_bad_request_names_its_field(client, path, body, field):
    if path == "control":
        path = f"/v1/sessions/{(await create(client))['id']}/control"
    response = await client.post(path, json=body)
    assert response.status_code == 400
    assert response.json()["errors"][0]["field"] == field


async def test_frames_of_no_session_are_a_problem_not_a_stream(client):
    response = await client.get("/v1/sessions/none/frames")
    assert response.status_code == 404
    assert response.json()["reason"] == "SESSION_NOT_FOUND"


async def test_openapi_describes_every_route(client):
    paths = (await client.get("/openapi.json")).json()["paths"]
    assert {
        "/v1/sessions",
        "/v1/sessions/{session}",
        "/v1/sessions/{session}/control",
        "/v1/sessions/{session}/frames",
    } <= set(paths)
    for path, methods in paths.items():
        for name, method in methods.items():
            assert method["summary"], f"{name} {path}"
