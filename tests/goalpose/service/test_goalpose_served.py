"""The real synthesizer with the shipped weights behind a real server."""

import grpc
import numpy as np
import pytest
from roam.v1 import goal_pose_pb2, goal_pose_pb2_grpc, skeleton_pb2
from roam_character.kinematics import forward_kinematics
from roam_character.skeleton import humanoid_skeleton
from roam_goalpose.app import GoalPoseService
from roam_goalpose.settings import GoalPoseSettings
from roam_goalpose.synthesis import SynthesizerSettings
from roam_serving.server import running

SHIPPED = SynthesizerSettings()
CHAIR = SHIPPED.references.parent / "objects" / "chair.glb"

pytestmark = pytest.mark.skipif(not SHIPPED.weights.exists(), reason="weights/field.safetensors is not there")


async def test_a_chair_goes_in_and_a_sitting_person_comes_out():
    settings = GoalPoseSettings(isolate_uploads=False)
    async with (
        running([GoalPoseService(settings)], settings) as addresses,
        grpc.aio.insecure_channel(addresses.grpc) as channel,
    ):
        stub = goal_pose_pb2_grpc.GoalPoseServiceStub(channel)
        upload = [goal_pose_pb2.UploadObjectRequest(format="glb", chunk=CHAIR.read_bytes())]
        chair = (await stub.UploadObject(iter(upload))).object
        request = goal_pose_pb2.SynthesizeRequest(object=chair.name, reference_pose="referencePoses/chair_sit")
        messages = [message async for message in stub.Synthesize(request)]
    progress = [message.progress for message in messages[:-1]]
    stages = [step.stage for step in progress]  # the newest ten times a second: a quick stage may pass between
    assert stages == sorted(stages)
    assert set(stages) & {1, 2, 3}
    done = [step.iteration for step in progress]
    assert done == sorted(done)
    found = messages[-1].goal_pose
    assert found.energies["total"] <= min(step.energy for step in progress if step.stage > 0) * 1.05
    assert found.action == skeleton_pb2.ACTION_SIT
    rotations = np.frombuffer(found.pose.rotations, "<f4").reshape(-1, 4)
    root = np.frombuffer(found.pose.root_position, "<f4")
    positions = np.frombuffer(found.joint_positions, "<f4").reshape(-1, 3)
    assert np.abs(forward_kinematics(humanoid_skeleton(), root, rotations)[0] - positions).max() < 1e-4
    assert found.diagnostics["hip_seat_distance"] < 0.08
    inside = (root[[0, 2]] > np.array(chair.bounds_min)[[0, 2]]) & (root[[0, 2]] < np.array(chair.bounds_max)[[0, 2]])
    assert inside.all()
    assert chair.floor_height + 0.3 < root[1] < chair.bounds_max[1]
