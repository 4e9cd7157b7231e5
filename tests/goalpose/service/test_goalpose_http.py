"""The goal pose service over HTTP: what curl sees."""

import asyncio
import json
import threading

import httpx
import numpy as np
import psutil
import pytest
import trimesh
from poser import box_file
from roam_character.skeleton import humanoid_skeleton
from roam_goalpose.app import GoalPoseService
from roam_goalpose.energy.terms import default_weights
from roam_goalpose.settings import GoalPoseSettings
from roam_goalpose.synthesis import Synthesizer
from roam_serving.server import running


@pytest.fixture
async def client(goalpose_addresses):
    async with httpx.AsyncClient(base_url=goalpose_addresses.http, timeout=30) as client:
        yield client


async def upload(client, **keywords):
    keywords.setdefault("content", box_file())
    return await client.post("/v1/objects", **keywords)


async def box(client):
    response = await upload(client)
    assert response.status_code == 201, response.text
    return response.json()["name"]


async def test_the_same_file_is_the_same_object_however_it_is_sent(client):
    data = box_file()
    answers = [
        await upload(client, params={"format": "glb"}),
        await upload(client, headers={"Content-Type": "model/gltf-binary"}),
        await upload(client, headers={"Content-Disposition": 'attachment; filename="box.glb"'}),
        await upload(client),  # by its first bytes
        await client.post("/v1/objects", files={"file": ("box.glb", data)}),
        await client.post("/v1/objects", files={"file": ("box", data)}, data={"format": "glb", "up": "y", "unit": "m"}),
    ]
    assert [answer.status_code for answer in answers] == [201] * 6
    assert len({answer.json()["name"] for answer in answers}) == 1
    found = answers[0].json()
    assert (found["format"], found["unit"], found["up_axis"]) == ("glb", "m", "y")
    assert found["object_to_world"] == np.eye(4).tolist()
    assert found["floor_height"] == pytest.approx(-0.25, abs=1e-3)
    assert np.ptp(found["bounds"], axis=0) == pytest.approx([0.5] * 3, abs=1e-3)
    assert (await client.get(f"/v1/{found['name']}")).json() == found


async def test_unit_and_up_axis_are_told_back(client):
    box = trimesh.creation.box((400, 500, 900)).export(file_type="stl")
    found = (await upload(client, content=box, params={"format": "stl", "unit": "mm", "up": "z"})).json()
    assert (found["unit"], found["up_axis"]) == ("mm", "z")
    assert np.ptp(found["bounds"], axis=0) == pytest.approx([0.4, 0.9, 0.5], abs=1e-3)
    corner = np.array(found["object_to_world"]) @ [200, 250, 450, 1]
    assert np.abs(corner[:3]) == pytest.approx([0.2, 0.45, 0.25], abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "status", "reason", "field"),
    [
        ({"content": b"?"}, 400, "INVALID_ARGUMENT", "format"),
        ({"content": b""}, 400, "INVALID_ARGUMENT", "format"),
        ({"content": b"", "params": {"format": "glb"}}, 422, "OBJECT_EMPTY", "content"),
        ({"content": b"?", "params": {"format": "glb"}}, 422, "OBJECT_MALFORMED", "content"),
        ({"content": b"?", "params": {"format": "docx"}}, 422, "OBJECT_FORMAT_UNKNOWN", "format"),
        (
            {"content": b"?", "headers": {"Content-Disposition": 'x; filename="a.step"'}},
            422,
            "OBJECT_FORMAT_UNSUPPORTED",
            "format",
        ),
        ({"params": {"unit": "parsec"}}, 422, "OBJECT_UNIT_UNKNOWN", "unit"),
        ({"params": {"up": "w"}}, 422, "OBJECT_UP_UNKNOWN", "up"),
        ({"content": b"glTF" + b"x" * 300_000}, 413, "PAYLOAD_TOO_LARGE", None),
        ({"content": None, "files": {"other": b"x"}}, 400, "INVALID_ARGUMENT", "file"),
    ],
)
async def test_a_bad_upload_says_what_to_do(client, arguments, status, reason, field):
    response = await upload(client, **arguments)
    problem = response.json()
    assert (response.status_code, problem["reason"]) == (status, reason)
    assert problem["remedy"]
    if field:
        assert problem["errors"][0]["field"] == field


async def test_an_unknown_object_is_not_found(client):
    response = await client.get("/v1/objects/sha256:00")
    assert (response.status_code, response.json()["reason"]) == (404, "OBJECT_NOT_FOUND")


async def test_a_goal_pose_in_one_answer(client):
    name = await box(client)
    response = await client.post("/v1/goal-poses", json={"object": name, "reference_pose": "referencePoses/chair_sit"})
    assert response.status_code == 200, response.text
    answer = response.json()
    assert answer["object"] == name
    assert (answer["reference_pose"], answer["action"]) == ("referencePoses/chair_sit", "sit")
    assert np.shape(answer["pose"]["rotations"]) == (22, 4)
    assert answer["joint_positions"][0] == pytest.approx(answer["pose"]["root_position"])
    assert answer["energies"]["total"] == 1.0
    assert answer["warnings"][0]["remedy"] == "Use a real synthesizer."
    assert response.headers["x-roam-cache"] == "miss"


async def test_identical_requests_are_answered_from_the_cache(client, poser):
    body = {"object": await box(client), "action": "sit", "seed": 4}
    first = await client.post("/v1/goal-poses", json=body)
    second = await client.post("/v1/goal-poses", json=body)
    other = await client.post("/v1/goal-poses", json=body | {"seed": 5})
    assert [answer.headers["x-roam-cache"] for answer in (first, second, other)] == ["miss", "hit", "miss"]
    assert first.content == second.content != other.content
    assert len(poser.runs) == 2
    assert "roam_goalpose_cache_hits_total 1.0" in (await client.get("/metrics")).text


async def test_inline_points_need_no_upload(client):
    points = trimesh.creation.box((0.5, 0.5, 0.5)).sample(600, seed=1).tolist()
    response = await client.post("/v1/goal-poses", json={"points": points, "action": "lie"})
    assert response.status_code == 200, response.text
    assert response.json()["reference_pose"] == "referencePoses/sofa_lie"


async def test_progress_streams_as_events(client):
    body = {"object": await box(client), "action": "sit"}
    response = await client.post("/v1/goal-poses", json=body, headers={"Accept": "text/event-stream"})
    assert response.headers["content-type"].startswith("text/event-stream")
    events = dict(
        zip(
            *[iter(line for line in response.text.splitlines() if line.startswith(("event:", "data:")))] * 2,
            strict=True,
        )
    )
    progress = json.loads(events["event: progress"].removeprefix("data: "))
    assert (progress["stage"], progress["stage_name"], progress["pose"]) == (0, "preparing", None)
    goal_pose = json.loads(events["event: goal_pose"].removeprefix("data: "))
    plain = await client.post("/v1/goal-poses", json=body)
    assert plain.json() == goal_pose


@pytest.mark.parametrize(
    ("changes", "status", "reason", "field"),
    [
        ({"object": ""}, 400, "INVALID_ARGUMENT", "object"),
        ({"object": "objects/sha256:00"}, 404, "OBJECT_NOT_FOUND", "object"),
        ({"points": [[0, 0, 0]] * 3}, 400, "INVALID_ARGUMENT", "points"),
        ({"object": "", "points": [[0, 0]]}, 400, "INVALID_ARGUMENT", "points.0"),
        ({"object": "", "points": [[0, 0, 0]] * 1001}, 400, "INVALID_ARGUMENT", "points"),
        ({"object": "", "points": [[0, 0, 0]] * 3}, 422, None, "content"),
        ({"action": None}, 400, "INVALID_ARGUMENT", "action"),
        ({"action": "jump"}, 400, "INVALID_ARGUMENT", "action"),
        ({"reference_pose": "handstand"}, 404, "REFERENCE_POSE_NOT_FOUND", "reference_pose"),
        ({"restarts": 1000}, 400, "INVALID_ARGUMENT", "restarts"),
        ({"solver": "magic"}, 400, "INVALID_ARGUMENT", "solver"),
        ({"initial_yaw": 1e9}, 400, "INVALID_ARGUMENT", "initial_yaw"),
        ({"skeleton_id": "sha256:00"}, 404, "SKELETON_NOT_FOUND", "skeleton_id"),
        ({"surprise": 1}, 400, "INVALID_ARGUMENT", "surprise"),
    ],
)
async def test_a_bad_request_names_its_field(client, changes, status, reason, field):
    body = {"object": await box(client), "action": "sit"} | changes
    response = await client.post("/v1/goal-poses", json=body)
    problem = response.json()
    assert response.status_code == status
    assert reason in (None, problem["reason"])
    assert problem["errors"][0]["field"] == field


async def test_reference_poses_with_and_without_points(client):
    plain = (await client.get("/v1/reference-poses")).json()["reference_poses"]
    full = (await client.get("/v1/reference-poses", params={"include_points": True})).json()["reference_poses"]
    assert [(pose["name"], pose["action"]) for pose in plain] == [
        ("referencePoses/chair_sit", "sit"),
        ("referencePoses/sofa_lie", "lie"),
    ]
    assert plain[0]["object_points"] is None
    assert np.shape(full[0]["object_points"])[1] == 3


async def test_a_caller_who_hangs_up_stops_the_work(client, poser):
    poser.gate = threading.Event()
    body = {"object": await box(client), "action": "sit"}
    with pytest.raises(httpx.ReadTimeout):
        await client.post("/v1/goal-poses", json=body, timeout=0.3)
    assert await asyncio.to_thread(poser.stopped.wait, 10)


async def test_two_callers_share_one_run_and_one_may_leave(client, poser):
    poser.gate = threading.Event()
    body = {"object": await box(client), "action": "sit"}
    staying = asyncio.create_task(client.post("/v1/goal-poses", json=body))
    with pytest.raises(httpx.ReadTimeout):
        await client.post("/v1/goal-poses", json=body, timeout=0.3)
    poser.gate.set()
    assert (await staying).status_code == 200
    assert len(poser.runs) == 1


async def test_a_full_queue_says_when_to_come_back(client, poser):
    poser.gate = threading.Event()
    name = await box(client)

    def ask(seed):
        return client.post("/v1/goal-poses", json={"object": name, "action": "sit", "seed": seed})

    waiting = [asyncio.create_task(ask(seed)) for seed in (1, 2)]
    while "roam_synthesis_queue_depth 2.0" not in (await client.get("/metrics")).text:
        await asyncio.sleep(0.01)
    refused = await ask(3)
    assert (refused.status_code, refused.json()["reason"]) == (429, "QUEUE_FULL")
    assert int(refused.headers["retry-after"]) >= 1
    poser.gate.set()
    assert [answer.status_code for answer in await asyncio.gather(*waiting)] == [200, 200]


async def test_openapi_describes_every_route(client):
    paths = (await client.get("/openapi.json")).json()["paths"]
    assert {"/v1/objects", "/v1/objects/{object}", "/v1/goal-poses", "/v1/reference-poses"} <= set(paths)
    assert "model/gltf-binary" in paths["/v1/objects"]["post"]["requestBody"]["content"]
    for path, methods in paths.items():
        for name, method in methods.items():
            assert method["summary"], f"{name} {path}"


async def test_uploads_are_read_in_a_child_process(monkeypatch, poser):
    monkeypatch.setattr(Synthesizer, "load", classmethod(lambda cls, settings: poser))
    settings = GoalPoseSettings()
    service = GoalPoseService(settings)
    async with (
        running([service], settings) as addresses,
        httpx.AsyncClient(base_url=addresses.http, timeout=30) as client,
    ):
        readers = [child for child in psutil.Process().children() if "roam_goalpose.objects.worker" in child.cmdline()]
        assert readers
        assert (await upload(client)).status_code == 201
        refused = await upload(client, content=b"?", params={"format": "glb"})
        assert refused.json()["reason"] == "OBJECT_MALFORMED"
    assert not any(reader.is_running() for reader in readers)


def skeleton_json(scale=1.0):
    """The default skeleton, scaled, as a request brings it."""
    skeleton = humanoid_skeleton()
    return {
        "joint_names": list(skeleton.joint_names),
        "parents": list(skeleton.parents),
        "rest_offsets": (scale * skeleton.rest_offsets).tolist(),
        "humanoid_bones": list(skeleton.humanoid_bones),
        "tips": [{"name": t.name, "joint": t.parent, "offset": [scale * x for x in t.offset]} for t in skeleton.tips],
    }


async def test_several_poses_with_their_quality(client):
    answer = (
        await client.post("/v1/goal-poses", json={"object": await box(client), "action": "sit", "count": 3})
    ).json()
    assert len(answer["alternatives"]) == 2
    assert answer["alternatives"][1]["energies"]["total"] == pytest.approx(3.0)
    assert answer["place"] == pytest.approx([0, 0.25, 0], abs=1e-3)
    quality = answer["quality"]
    assert quality["penetration_depth"] == 0.25
    assert [bone["bone"] for bone in quality["bone_penetrations"]] == ["leftFoot"]
    assert 0 < quality["penetration_volume"] == quality["bone_penetrations"][0]["volume"] < 0.02
    assert quality["descriptor_residual"] == pytest.approx(1.0 / default_weights()["descriptor"])
    assert quality["floor_distance"] is None


async def test_wishes_reach_the_solver(client, poser):
    wishes = {"seat_point": [0.1, 0.4, 0], "facing": 1.5, "hand_targets": {"left": [0.3, 0.7, 0.1]}}
    body = {"object": await box(client), "action": "sit", "constraints": wishes, "weights": {"prior": 0}}
    assert (await client.post("/v1/goal-poses", json=body)).status_code == 200
    asked = poser.runs[-1]
    assert asked.constraints.seat_point == (0.1, 0.4, 0)
    assert asked.constraints.facing == 1.5
    assert asked.constraints.hands == (("left", pytest.approx((0.3, 0.7, 0.1))),)
    assert asked.weights == (("prior", 0.0),)


async def test_a_person_of_other_proportions(client, poser):
    body = {"object": await box(client), "action": "sit", "skeleton": skeleton_json(1.2)}
    answer = (await client.post("/v1/goal-poses", json=body)).json()
    assert poser.runs[-1].skeleton.rest_offsets[1] == pytest.approx(1.2 * humanoid_skeleton().rest_offsets[1])
    assert answer["skeleton"]["rest_offsets"][1] == pytest.approx(1.2 * humanoid_skeleton().rest_offsets[1], abs=1e-5)
    assert answer["pose"]["skeleton_id"] == poser.runs[-1].skeleton.id


async def own_reference(client, place, **changes):
    skeleton = humanoid_skeleton()
    rotations = [[0, 0, 0, 2]] * skeleton.joint_count  # normalised by the server
    body = {"object": place, "pose": {"root_position": [0, 0.35, 0], "rotations": rotations}, "action": "lie"}
    return await client.post("/v1/reference-poses", json=body | changes)


async def test_a_pose_of_ones_own_is_a_reference(client, poser):
    object = await box(client)
    made = await own_reference(client, object, title="mine")
    assert made.status_code == 201, made.text
    name = made.json()["name"]
    assert name == (await own_reference(client, object)).json()["name"]  # a content hash, whatever the title
    answer = (await client.post("/v1/goal-poses", json={"object": object, "reference_pose": name})).json()
    assert (answer["reference_pose"], answer["action"]) == (name, "lie")
    assert poser.runs[-1].pair.pose.rotations[0].tolist() == [0, 0, 0, 1]
    listed = (await client.get("/v1/reference-poses")).json()["reference_poses"]
    assert name not in [pose["name"] for pose in listed]  # other callers need not see it


@pytest.mark.parametrize(
    ("changes", "status", "reason", "field"),
    [
        ({"pose": {"root_position": [0, 2, 0], "rotations": [[0, 0, 0, 1]] * 22}}, 422, "REFERENCE_POSE_UNFIT", "pose"),
        ({"pose": {"root_position": [0, 0, 0], "rotations": [[0, 0, 0, 1]] * 3}}, 400, "INVALID_ARGUMENT", "pose"),
        ({"pose": {"root_position": [0, 0, 0], "rotations": [[0, 0, 0, 0]] * 22}}, 400, "INVALID_ARGUMENT", "pose"),
        ({"object": "objects/sha256:0"}, 404, "OBJECT_NOT_FOUND", "object"),
    ],
)
async def test_a_reference_that_cannot_be_says_why(client, changes, status, reason, field):
    response = await own_reference(client, await box(client), **changes)
    problem = response.json()
    assert (response.status_code, problem["reason"]) == (status, reason), problem
    assert problem["errors"][0]["field"] == field


@pytest.mark.parametrize(
    ("wish", "field"),
    [
        ({"count": 17}, "count"),
        ({"weights": {"charm": 1}}, "weights"),
        ({"weights": {"prior": -1}}, "weights"),
        ({"constraints": {"seat_point": [1e6, 0, 0]}}, "constraints"),
        ({"skeleton": skeleton_json() | {"humanoid_bones": [""] * 22}}, "skeleton"),
        ({"skeleton": skeleton_json() | {"parents": [-1] * 22}}, "skeleton"),
        ({"solver": "paper", "count": 2}, "solver"),
        ({"solver": "paper", "constraints": {"facing": 1}}, "solver"),
    ],
)
async def test_wishes_that_cannot_be_meant_name_their_field(client, wish, field):
    body = {"object": await box(client), "action": "sit"} | wish
    response = await client.post("/v1/goal-poses", json=body)
    problem = response.json()
    assert (response.status_code, problem["reason"]) == (400, "INVALID_ARGUMENT"), problem
    assert problem["errors"][0]["field"] == field
