"""A further action: one module that registers it, and clients ask for it by its name or number."""

import json
from dataclasses import replace

import grpc
import httpx
import numpy as np
import pytest
from roam.v1 import motion_pb2, motion_pb2_grpc, skeleton_pb2
from roam_character.pose import rest_pose
from roam_character.skeleton import humanoid_skeleton
from roam_motion import actions
from roam_motion.actions import ACTIONS, Action
from roam_motion.app import SHIPPED_WEIGHTS, MotionService
from roam_motion.control.actions import GOAL_ACTIONS, register
from roam_motion.control.actions.sit import Sit
from roam_motion.settings import MotionSettings
from roam_serving.server import running

LEAN = Action("lean", 77, "sit")  # the shipped network was shown no other pose taken on one's feet
PLACE = np.array([0.4, 0.0, 1.5])  # [m] where the hips lean


class Lean(Sit):
    """On both hands over a table: one walks up facing it, and stands nearer than before a chair."""

    def seat(self, figure, goal, place):
        return replace(super().seat(figure, goal, place), action=LEAN.name)

    def room(self, figure, goal):
        x, _, z = map(float, goal.pose.root_position)
        return ((x - 0.3, z + 0.5), (x + 0.3, z + 0.5), (x + 0.3, z + 0.9), (x - 0.3, z + 0.9))


@pytest.fixture
def lean():
    register(LEAN, Lean())
    yield LEAN
    del ACTIONS[LEAN.name], GOAL_ACTIONS[LEAN.name]


@pytest.fixture
async def addresses(lean):
    if not SHIPPED_WEIGHTS.exists():
        pytest.skip("weights/motion.safetensors is not there: train or fetch it")
    settings = MotionSettings(step_process=False)
    async with running([MotionService(settings)], settings) as addresses:
        yield addresses


def leaning():
    """Standing, the trunk bent forward over the table by 20 degrees."""
    skeleton = humanoid_skeleton()
    pose = rest_pose(skeleton)
    rotations = pose.rotations.astype(np.float32).copy()
    rotations[skeleton.index("spine")] = [np.sin(np.radians(10)), 0, 0, np.cos(np.radians(10))]
    for side, sign in (("left", -1), ("right", 1)):
        rotations[skeleton.index(f"{side}UpperArm")] = [0, 0, np.sin(sign * 0.6), np.cos(0.6)]
    return PLACE + np.array([0.0, float(pose.root_position[1]), 0.0]), rotations


async def test_a_new_action_is_asked_for_by_name_over_http(addresses):
    position, rotations = leaning()
    goal = {"action": "lean", "pose": {"root_position": position.tolist(), "rotations": rotations.tolist()}}
    async with httpx.AsyncClient(base_url=addresses.http, timeout=120) as client:
        session = (await client.post("/v1/sessions", json={"seed": 3})).json()
        answer = await client.post(f"/v1/sessions/{session['id']}/control", json={"goal": goal})
        assert answer.status_code == 200, answer.text
        answer = await client.get(
            f"/v1/sessions/{session['id']}/frames", params={"pacing": "burst", "count": 300, "positions": True}
        )
        schema = (await client.get("/openapi.json")).json()["components"]["schemas"]["GoalJson"]
    frames = [line for line in map(json.loads, answer.text.splitlines()) if line["type"] == "frame"]
    assert frames[0]["action"] != "lean"
    assert frames[-1]["action"] == "lean"
    assert frames[-1]["goal_distance"] < 0.05
    assert np.abs(np.array(frames[-1]["root_position"]) - position).max() < 0.05
    assert "lean" in schema["properties"]["action"]["enum"]


async def test_a_new_action_is_asked_for_by_number_over_grpc(addresses):
    position, rotations = leaning()
    pose = skeleton_pb2.Pose(root_position=position.astype("<f4").tobytes(), rotations=rotations.tobytes())
    control = motion_pb2.ControlInput(goal=motion_pb2.Goal(pose=pose, action=LEAN.number))
    async with grpc.aio.insecure_channel(addresses.grpc) as channel:
        stub = motion_pb2_grpc.MotionServiceStub(channel)
        session = (await stub.CreateSession(motion_pb2.CreateSessionRequest(seed=3))).session
        await stub.Control(motion_pb2.ControlRequest(session=session.name, control=control))
        opening = motion_pb2.Open(session=session.name, pacing=motion_pb2.PACING_BURST)
        async for response in stub.WatchFrames(motion_pb2.WatchFramesRequest(open=opening)):
            if response.message.frame.sequence >= 300:
                break
    assert response.message.frame.action == LEAN.number


@pytest.mark.parametrize("taken", [Action("lean", 78, "idle"), Action("other", 77, "idle"), Action("sit", 5, "sit")])
def test_names_and_numbers_are_taken_once(lean, taken):
    with pytest.raises(ValueError, match="is there"):
        register(taken, Lean())


def test_an_action_needs_a_style_that_networks_know():
    with pytest.raises(ValueError, match="'dance' is none of"):
        actions.register(Action("dance", 9, "dance"))
