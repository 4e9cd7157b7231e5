"""The goal pose service over real gRPC connections."""

import asyncio
import threading

import grpc
import numpy as np
import pytest
import trimesh
from google.rpc import error_details_pb2
from grpc_status import rpc_status
from poser import box_file
from roam.v1 import goal_pose_pb2, goal_pose_pb2_grpc, server_pb2, server_pb2_grpc, skeleton_pb2


@pytest.fixture
async def channel(goalpose_addresses):
    async with grpc.aio.insecure_channel(goalpose_addresses.grpc) as channel:
        yield channel


@pytest.fixture
def stub(channel):
    return goal_pose_pb2_grpc.GoalPoseServiceStub(channel)


def chunks(data, size=1000, **first):
    for start in range(0, len(data), size):
        yield goal_pose_pb2.UploadObjectRequest(chunk=data[start : start + size], **(first if start == 0 else {}))


async def box(stub):
    return (await stub.UploadObject(chunks(box_file(), format="glb"))).object


async def refusal(awaitable):
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await awaitable
    details = {}
    for packed in rpc_status.from_call(caught.value).details:
        for kind in (error_details_pb2.ErrorInfo, error_details_pb2.BadRequest):
            message = kind()
            if packed.Unpack(message):
                details[kind] = message
    return caught.value.code(), details[error_details_pb2.ErrorInfo].reason, details.get(error_details_pb2.BadRequest)


async def result(call):
    messages = [message async for message in call]
    assert all(message.WhichOneof("message") == "progress" for message in messages[:-1])
    return messages[-1].goal_pose


async def test_upload_in_chunks_and_read_back(stub):
    uploaded = await box(stub)
    assert uploaded.name.startswith("objects/sha256:")
    assert np.reshape(uploaded.object_to_world, (4, 4)).tolist() == np.eye(4).tolist()
    read = (await stub.GetObject(goal_pose_pb2.GetObjectRequest(name=uploaded.name))).object
    assert read == uploaded


@pytest.mark.parametrize(
    ("requests", "code", "reason"),
    [
        ([], grpc.StatusCode.INVALID_ARGUMENT, "INVALID_ARGUMENT"),
        (chunks(b"?", format="glb"), grpc.StatusCode.INVALID_ARGUMENT, "OBJECT_MALFORMED"),
        (chunks(b"?", format="step"), grpc.StatusCode.INVALID_ARGUMENT, "OBJECT_FORMAT_UNSUPPORTED"),
        (chunks(b"?" * 300_000, 50_000, format="obj"), grpc.StatusCode.RESOURCE_EXHAUSTED, "PAYLOAD_TOO_LARGE"),
    ],
)
async def test_a_bad_upload_is_refused_with_a_reason(stub, requests, code, reason):
    assert (await refusal(stub.UploadObject(iter(requests))))[:2] == (code, reason)


async def test_synthesize_streams_progress_then_the_pose(stub):
    name = (await box(stub)).name
    request = goal_pose_pb2.SynthesizeRequest(object=name, reference_pose="referencePoses/chair_sit", seed=7)
    call = stub.Synthesize(request)
    pose = await result(call)
    assert pose.name == f"goalPoses/sha256:{7:064x}"
    assert (pose.object, pose.reference_pose, pose.action) == (
        name,
        "referencePoses/chair_sit",
        skeleton_pb2.ACTION_SIT,
    )
    positions = np.frombuffer(pose.joint_positions, "<f4").reshape(-1, 3)
    assert positions[0] == pytest.approx(np.frombuffer(pose.pose.root_position, "<f4"))
    assert dict(pose.energies) == {"descriptor": 1.0, "total": 1.0}
    assert pose.warnings[0].reason == "DEEP_PENETRATION"
    assert dict(await call.trailing_metadata())["x-roam-cache"] == "miss"
    again = stub.Synthesize(request)
    assert await result(again) == pose
    assert dict(await again.trailing_metadata())["x-roam-cache"] == "hit"


async def test_synthesize_from_inline_points_by_action(stub):
    points = trimesh.creation.box((0.5, 0.5, 0.5)).sample(600, seed=1).astype("<f4").tobytes()
    request = goal_pose_pb2.SynthesizeRequest(points=points, action=skeleton_pb2.ACTION_LIE)
    assert (await result(stub.Synthesize(request))).reference_pose == "referencePoses/sofa_lie"


@pytest.mark.parametrize(
    ("request_fields", "code", "reason", "field"),
    [
        ({"object": "objects/sha256:00", "action": 3}, grpc.StatusCode.NOT_FOUND, "OBJECT_NOT_FOUND", "object"),
        ({"points": b"12345", "action": 3}, grpc.StatusCode.INVALID_ARGUMENT, "INVALID_ARGUMENT", "points"),
        ({"points": b"\0" * 36, "action": 2}, grpc.StatusCode.INVALID_ARGUMENT, "INVALID_ARGUMENT", "action"),
        (
            {"points": b"\0" * 36, "reference_pose": "referencePoses/none"},
            grpc.StatusCode.NOT_FOUND,
            "REFERENCE_POSE_NOT_FOUND",
            "reference_pose",
        ),
    ],
)
async def test_a_bad_request_names_its_field(stub, request_fields, code, reason, field):
    call = stub.Synthesize(goal_pose_pb2.SynthesizeRequest(**request_fields))
    found_code, found_reason, violations = await refusal(call.read())
    assert (found_code, found_reason) == (code, reason)
    assert violations.field_violations[0].field == field


async def test_cancelling_the_call_stops_the_work(stub, poser):
    poser.gate = threading.Event()
    call = stub.Synthesize(goal_pose_pb2.SynthesizeRequest(object=(await box(stub)).name, action=3))
    assert (await call.read()).progress.stage_name == "preparing"
    call.cancel()
    while not poser.stopped.wait(0):
        await asyncio.sleep(0.005)


async def test_reference_poses_and_server_info(channel, stub):
    poses = (await stub.ListReferencePoses(goal_pose_pb2.ListReferencePosesRequest())).reference_poses
    assert [pose.name for pose in poses] == ["referencePoses/chair_sit", "referencePoses/sofa_lie"]
    assert not poses[0].object_points
    full = await stub.ListReferencePoses(goal_pose_pb2.ListReferencePosesRequest(include_points=True))
    assert len(full.reference_poses[0].object_points) % 12 == 0
    assert full.reference_poses[0].object_points
    info = await server_pb2_grpc.ServerServiceStub(channel).GetServerInfo(server_pb2.GetServerInfoRequest())
    assert list(info.services) == ["goalpose"]
    assert dict(info.models) == {"field": "sha256:poser"}
    assert info.limits["max_upload_bytes"] == 200_000


async def test_a_reference_of_ones_own_and_a_constrained_pose_on_it(stub, poser):
    place = await box(stub)
    skeleton = poser.references["chair_sit"].pose.skeleton
    rotations = np.tile(np.array([0, 0, 0, 1], "<f4"), (skeleton.joint_count, 1)).tobytes()
    pose = skeleton_pb2.Pose(root_position=np.array([0, 0.3, 0], "<f4").tobytes(), rotations=rotations)
    request = goal_pose_pb2.CreateReferencePoseRequest(object=place.name, pose=pose, action=skeleton_pb2.ACTION_SIT)
    made = (await stub.CreateReferencePose(request)).reference_pose
    assert made.name.startswith("referencePoses/sha256:")
    wishes = goal_pose_pb2.PoseConstraints(facing=0.0)
    asked = goal_pose_pb2.SynthesizeRequest(object=place.name, reference_pose=made.name, constraints=wishes, count=2)
    found = await result(stub.Synthesize(asked))
    assert found.reference_pose == made.name
    assert len(found.alternatives) == 1
    assert found.quality.HasField("descriptor_residual")
    assert poser.runs[-1].constraints.facing == 0.0


async def test_a_hand_named_twice_is_refused(stub):
    place = await box(stub)
    target = goal_pose_pb2.HandTarget(hand=goal_pose_pb2.HAND_LEFT, position=[0, 0, 0])
    wishes = goal_pose_pb2.PoseConstraints(hand_targets=[target, target])
    asked = goal_pose_pb2.SynthesizeRequest(object=place.name, action=skeleton_pb2.ACTION_SIT, constraints=wishes)
    code, reason, bad = await refusal(result(stub.Synthesize(asked)))
    assert (code, reason) == (grpc.StatusCode.INVALID_ARGUMENT, "INVALID_ARGUMENT")
    assert bad.field_violations[0].field == "constraints"
