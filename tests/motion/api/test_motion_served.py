"""The real animator with the shipped weights behind a real server."""

import asyncio

import grpc
import numpy as np
import pytest
from roam.v1 import motion_pb2, motion_pb2_grpc, skeleton_pb2
from roam_character.kinematics import forward_kinematics
from roam_character.skeleton import humanoid_skeleton
from roam_goalpose.references.pairs import load_reference
from roam_motion.app import SHIPPED_WEIGHTS, MotionService
from roam_motion.settings import MotionSettings
from roam_serving.server import running

REFERENCE = SHIPPED_WEIGHTS.parents[1] / "examples" / "references" / "chair_sit.json"

pytestmark = pytest.mark.skipif(not SHIPPED_WEIGHTS.exists(), reason="weights/motion.safetensors is not there")


@pytest.fixture(params=[True, False], ids=["in a process of its own", "in the server's"])
async def stub(request):
    settings = MotionSettings(step_process=request.param)
    async with (
        running([MotionService(settings)], settings) as addresses,
        grpc.aio.insecure_channel(addresses.grpc) as channel,
    ):
        yield motion_pb2_grpc.MotionServiceStub(channel)


async def create(stub, **fields):
    return (await stub.CreateSession(motion_pb2.CreateSessionRequest(**fields))).session.name


async def control(stub, session, **intent):
    request = motion_pb2.ControlRequest(session=session, control=motion_pb2.ControlInput(control_id=1, **intent))
    await stub.Control(request)


async def bake(stub, session, count):
    """`count` frames, and the events on the way."""
    frames, events = [], []
    opening = motion_pb2.Open(session=session, pacing=motion_pb2.PACING_CREDIT, credit=count, joint_positions=True)
    call = stub.WatchFrames(motion_pb2.WatchFramesRequest(open=opening))
    while len(frames) < count:
        message = (await call.read()).message
        if message.WhichOneof("message") == "frame":
            frames.append(message.frame)
        elif message.WhichOneof("message") == "event":
            events.append(message.event)
            if message.event.type == motion_pb2.EVENT_TYPE_GOAL_REACHED:
                break
    call.cancel()
    return frames, events


def bytes_of(frames):
    return [frame.SerializeToString(deterministic=True) for frame in frames]


async def test_frames_depend_on_seed_and_controls_only(stub):
    steer = motion_pb2.Steer(velocity_x=0.6, velocity_z=0.8)
    alone = await create(stub, seed=5)
    await control(stub, alone, steer=steer)
    first, _ = await bake(stub, alone, 25)
    crowd = [await create(stub, seed=5), await create(stub, seed=6), await create(stub, seed=7)]
    for session in crowd[:2]:
        await control(stub, session, steer=steer)
    together = await asyncio.gather(*(bake(stub, session, 25) for session in crowd))
    assert bytes_of(together[0][0]) == bytes_of(first)
    assert bytes_of(together[1][0]) != bytes_of(first)


async def test_frames_are_a_walking_person(stub):
    session = await create(stub, seed=1)
    await control(stub, session, steer=motion_pb2.Steer(velocity_z=1.0))
    frames, _ = await bake(stub, session, 45)
    skeleton = humanoid_skeleton()
    root = np.stack([np.frombuffer(frame.root, "<f4") for frame in frames])
    rotations = np.stack([np.frombuffer(frame.rotations, "<f4").reshape(-1, 4) for frame in frames])
    positions = np.stack([np.frombuffer(frame.joint_positions, "<f4").reshape(-1, 3) for frame in frames])
    assert np.linalg.norm(rotations, axis=-1) == pytest.approx(1, abs=1e-4)
    assert np.abs(root[:, 3:] - rotations[:, 0]).max() == 0
    assert np.abs(forward_kinematics(skeleton, root[:, :3], rotations)[0] - positions).max() < 2e-3
    assert np.linalg.norm(np.diff(positions, axis=0), axis=-1).max() < 0.15  # [m] per frame, swinging feet included
    assert root[-1, 2] - root[0, 2] > 0.4
    assert skeleton_pb2.ACTION_WALK in {frame.action for frame in frames}
    feet = [(bool(frame.contacts & 0b0011), bool(frame.contacts & 0b1100)) for frame in frames]
    assert {(True, False), (False, True)} <= set(feet)  # a step with each leg


async def test_a_goal_pose_is_reached_and_held(stub):
    pair = load_reference(REFERENCE)
    pose = skeleton_pb2.Pose(
        root_position=pair.pose.root_position.astype("<f4").tobytes(),
        rotations=pair.pose.rotations.astype("<f4").tobytes(),
    )
    session = await create(stub, start_placement=motion_pb2.Placement(z=1.2, yaw=np.pi))
    await control(stub, session, goal=motion_pb2.Goal(goal_pose="mine", pose=pose, action=skeleton_pb2.ACTION_SIT))
    frames, events = await bake(stub, session, 300)
    assert events[-1].goal_pose == "mine"
    assert frames[-1].goal_distance < 0.05
    assert frames[-1].action == skeleton_pb2.ACTION_SIT
    reached = np.frombuffer(frames[-1].joint_positions, "<f4").reshape(-1, 3)
    assert np.linalg.norm(reached - pair.pose.positions(), axis=-1).mean() < 0.05
