"""The motion service over real gRPC and WebSocket connections: the same bytes, the same errors."""

import asyncio
import itertools
import json

import grpc
import httpx
import numpy as np
import pytest
import websockets
from google.rpc import error_details_pb2
from grpc_status import rpc_status
from roam.v1 import motion_pb2, motion_pb2_grpc, skeleton_pb2, skeleton_pb2_grpc
from roam_motion.settings import MotionSettings
from roam_serving.server import Server

BURST = motion_pb2.PACING_BURST


@pytest.fixture
async def stub(motion_addresses):
    async with grpc.aio.insecure_channel(motion_addresses.grpc) as channel:
        yield motion_pb2_grpc.MotionServiceStub(channel)


async def create(stub, **fields):
    return (await stub.CreateSession(motion_pb2.CreateSessionRequest(**fields))).session


def reason(error):
    for packed in rpc_status.from_call(error).details:
        info = error_details_pb2.ErrorInfo()
        if packed.Unpack(info):
            return info.reason
    return None


def sit_at(skeleton, position):
    """A goal: the rest pose at a place, which is a fine pose as far as the protocol goes."""
    return motion_pb2.Goal(
        goal_pose="goalPoses/here",
        pose=skeleton_pb2.Pose(
            skeleton_id=skeleton.id,
            root_position=np.array(position, "<f4").tobytes(),
            rotations=skeleton.rest_rotations,
        ),
        action=skeleton_pb2.ACTION_SIT,
    )


async def read_frames(call, count):
    """The header, `count` frames and the events between them."""
    header, frames, events = None, [], []
    while len(frames) < count:
        response = await call.read()
        assert response is not grpc.aio.EOF
        if isinstance(response, motion_pb2.WatchFramesResponse):
            response = response.message
        kind = response.WhichOneof("message")
        if kind == "header":
            header = response.header
        elif kind == "event":
            events.append(response.event)
        else:
            frames.append(response.frame)
    return header, frames, events


async def test_life_of_a_session(stub):
    session = await create(stub, request_id="one", floor_height=0.25)
    again = await create(stub, request_id="one")
    assert again.name == session.name
    assert session.frame_rate == 30
    listed = (await stub.ListSessions(motion_pb2.ListSessionsRequest())).sessions
    assert [item.name for item in listed] == [session.name]
    got = (await stub.GetSession(motion_pb2.GetSessionRequest(name=session.name))).session
    assert got.floor_height == 0.25
    await stub.DeleteSession(motion_pb2.DeleteSessionRequest(name=session.name))
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        await stub.GetSession(motion_pb2.GetSessionRequest(name=session.name))
    assert caught.value.code() == grpc.StatusCode.NOT_FOUND
    assert reason(caught.value) == "SESSION_NOT_FOUND"


async def test_watch_and_control_reach_a_goal(stub):
    session = await create(stub)
    watching = stub.WatchFrames(
        motion_pb2.WatchFramesRequest(open=motion_pb2.Open(session=session.name, pacing=motion_pb2.PACING_CREDIT))
    )
    header = (await watching.read()).message.header
    watching.cancel()
    control = motion_pb2.ControlInput(control_id=1, goal=sit_at(header.skeleton, [0, 0.9, 2]))
    answer = await stub.Control(motion_pb2.ControlRequest(session=session.name, control=control))
    assert answer.effective_sequence == 1
    opening = motion_pb2.Open(session=session.name, pacing=BURST, joint_positions=True)
    reached = None
    async for response in stub.WatchFrames(motion_pb2.WatchFramesRequest(open=opening)):
        event = response.message.event
        if event.type == motion_pb2.EVENT_TYPE_GOAL_REACHED:
            reached = event
            break
        if response.message.WhichOneof("message") == "frame":
            last = response.message.frame
    assert reached.goal_pose == "goalPoses/here"
    assert last.sequence == reached.sequence
    assert last.goal_distance < 0.05
    assert last.action == skeleton_pb2.ACTION_SIT
    root = np.frombuffer(last.root, "<f4")
    assert np.linalg.norm(root[[0, 2]] - [0, 2]) < 0.1
    assert np.frombuffer(last.joint_positions, "<f4").reshape(-1, 3)[0] == pytest.approx(root[:3], abs=1e-5)


async def test_steering_moves_the_frame_that_the_answer_names_two_ticks_later_at_most(stub):
    session = await create(stub)
    watching = stub.WatchFrames(motion_pb2.WatchFramesRequest(open=motion_pb2.Open(session=session.name)))
    _, frames, _ = await read_frames(watching, 5)
    control = motion_pb2.ControlInput(control_id=1, steer=motion_pb2.Steer(velocity_z=1.5))
    answer = await stub.Control(motion_pb2.ControlRequest(session=session.name, control=control))
    head = (await stub.GetSession(motion_pb2.GetSessionRequest(name=session.name))).session.last_sequence
    assert frames[-1].sequence < answer.effective_sequence <= head + 2
    _, later, events = await read_frames(watching, 12)
    applied = [event for event in events if event.type == motion_pb2.EVENT_TYPE_CONTROL_APPLIED]
    assert [(event.control_id, event.sequence) for event in applied] == [(1, answer.effective_sequence)]
    for frame in (*frames, *later):
        steps = max(0, frame.sequence - answer.effective_sequence + 1)
        assert np.frombuffer(frame.root, "<f4")[2] == pytest.approx(steps * 1.5 / 30, abs=1e-5)


async def test_animate_takes_controls_and_credit_and_echoes_the_clock(stub):
    session = await create(stub)
    call = stub.Animate()
    opening = motion_pb2.Open(session=session.name, pacing=motion_pb2.PACING_CREDIT)
    await call.write(motion_pb2.AnimateRequest(open=opening))
    assert (await call.read()).header.first_sequence == 1
    control = motion_pb2.ControlInput(control_id=1, steer=motion_pb2.Steer(velocity_x=1))
    stamped = motion_pb2.AnimateRequest(control=control)
    stamped.client_time.FromSeconds(1234)
    await call.write(stamped)
    applied = await call.read()
    assert applied.event.type == motion_pb2.EVENT_TYPE_CONTROL_APPLIED
    assert (applied.event.control_id, applied.event.sequence) == (1, 1)
    assert applied.echo_client_time.seconds == 1234
    await call.write(motion_pb2.AnimateRequest(ack=motion_pb2.Ack(credit=3)))
    _, frames, _ = await read_frames(call, 3)
    assert [frame.sequence for frame in frames] == [1, 2, 3]
    assert frames[0].time == pytest.approx(1 / 30)
    assert frames[0].action == skeleton_pb2.ACTION_WALK
    call.cancel()


@pytest.mark.parametrize(
    ("requests", "expected"),
    [
        ([], "OPEN_REQUIRED"),
        ([motion_pb2.AnimateRequest(ack=motion_pb2.Ack(credit=1))], "OPEN_REQUIRED"),
        ([motion_pb2.AnimateRequest(open=motion_pb2.Open(session="sessions/none"))], "SESSION_NOT_FOUND"),
    ],
)
async def test_animate_refuses_a_bad_start(stub, requests, expected):
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        async for _ in stub.Animate(iter(requests)):
            pass
    assert reason(caught.value) == expected


async def test_animate_refuses_a_bad_control_after_its_start(stub):
    session = await create(stub)
    requests = [
        motion_pb2.AnimateRequest(open=motion_pb2.Open(session=session.name, pacing=motion_pb2.PACING_CREDIT)),
        motion_pb2.AnimateRequest(control=motion_pb2.ControlInput(steer=motion_pb2.Steer(velocity_x=float("nan")))),
    ]
    with pytest.raises(grpc.aio.AioRpcError) as caught:
        async for _ in stub.Animate(iter(requests)):
            pass
    assert reason(caught.value) == "INVALID_ARGUMENT"


async def test_a_broken_stream_is_resumed_without_a_gap(stub):
    session = await create(stub)
    opening = motion_pb2.Open(session=session.name, pacing=BURST)
    call = stub.Animate(iter([motion_pb2.AnimateRequest(open=opening)]))
    header, before, _ = await read_frames(call, 5)
    call.cancel()
    opening.after_sequence = 5
    opening.resume_token = header.resume_token
    opening.known_skeleton_id = header.skeleton.id
    call = stub.Animate(iter([motion_pb2.AnimateRequest(open=opening)]))
    resumed, after, _ = await read_frames(call, 5)
    call.cancel()
    assert [frame.sequence for frame in before + after] == list(range(1, 11))
    assert resumed.exact
    assert not resumed.discontinuity
    assert not resumed.skeleton.joint_names


async def test_a_lost_client_frees_its_stream(stub):
    session = await create(stub)
    call = stub.WatchFrames(motion_pb2.WatchFramesRequest(open=motion_pb2.Open(session=session.name)))
    await call.read()
    call.cancel()
    for _ in itertools.count():
        got = (await stub.GetSession(motion_pb2.GetSessionRequest(name=session.name))).session
        if got.stream_count == 0:
            break
        await asyncio.sleep(0.01)


async def test_snorm16_is_half_the_size_and_close(stub):
    session = await create(stub)
    calls = [
        stub.WatchFrames(
            motion_pb2.WatchFramesRequest(
                open=motion_pb2.Open(session=session.name, pacing=BURST, rotation_encodings=[encoding])
            )
        )
        for encoding in (motion_pb2.ROTATION_ENCODING_FLOAT32, motion_pb2.ROTATION_ENCODING_SNORM16)
    ]
    frames = []
    for call in calls:
        _, found, _ = await read_frames(call, 1)
        frames += found
        call.cancel()
    exact = np.frombuffer(frames[0].rotations, "<f4")
    packed = np.frombuffer(frames[1].rotations, "<i2") / 32767
    assert len(frames[1].rotations) * 2 == len(frames[0].rotations)
    assert np.abs(exact - packed).max() < 1 / 32767


async def test_floor_height_lifts_the_frames_and_lowers_the_goals(stub):
    low, high = await create(stub), await create(stub, floor_height=0.5)
    heights, distances = [], []
    for session in (low, high):
        # One frame, no more: a second one might or might not be computed before the goal arrives.
        opening = motion_pb2.Open(session=session.name, pacing=motion_pb2.PACING_CREDIT, credit=1)
        call = stub.Animate(iter([motion_pb2.AnimateRequest(open=opening)]))
        header, frames, _ = await read_frames(call, 1)
        call.cancel()
        heights.append(np.frombuffer(frames[0].root, "<f4")[1])
        goal = sit_at(header.skeleton, [0, 0.9 + session.floor_height, 0.2])
        control = motion_pb2.ControlInput(control_id=1, goal=goal)
        await stub.Control(motion_pb2.ControlRequest(session=session.name, control=control))
        opening.after_sequence, opening.credit = 1, 2
        call = stub.Animate(iter([motion_pb2.AnimateRequest(open=opening)]))
        _, frames, _ = await read_frames(call, 2)
        call.cancel()
        distances.append(frames[-1].goal_distance)
    assert heights[1] - heights[0] == pytest.approx(0.5, abs=1e-6)
    assert distances[0] == distances[1]


async def test_every_transport_tells_the_same(stub, motion_addresses):
    session = await create(stub)
    credit = motion_pb2.PACING_CREDIT
    opening = motion_pb2.Open(session=session.name, pacing=credit, credit=3, joint_positions=True)
    animate = stub.Animate(iter([motion_pb2.AnimateRequest(open=opening)]))
    first = [await animate.read() for _ in range(4)]
    watch = stub.WatchFrames(motion_pb2.WatchFramesRequest(open=opening))
    second = [(await watch.read()).message for _ in range(4)]
    async with websockets.connect(websocket_address(motion_addresses, session)) as socket:
        await socket.send(motion_pb2.AnimateRequest(open=opening).SerializeToString())
        third = [motion_pb2.AnimateResponse.FromString(await socket.recv()) for _ in range(4)]
    animate.cancel()
    watch.cancel()
    address = f"{motion_addresses.http}/v1/{session.name}/frames?pacing=burst&count=3&positions=true"
    async with httpx.AsyncClient() as client:
        header, *lines = [json.loads(line) for line in (await client.get(address, timeout=30)).text.splitlines()]
    for responses in (first, second, third):
        assert responses[0].header.stream
        responses[0].header.stream = ""
    assert first == second == third
    assert header["first_sequence"] == first[0].header.first_sequence
    for line, response in zip(lines, first[1:], strict=True):
        frame = response.frame
        assert (line["sequence"], line["time"]) == (frame.sequence, frame.time)
        assert np.float32(line["rotations"]).tobytes() == frame.rotations
        assert np.float32(line["joint_positions"]).tobytes() == frame.joint_positions
        assert np.float32(line["root_position"] + line["rotations"][0]).tobytes() == frame.root
        assert [frame.contacts >> bit & 1 == 1 for bit in range(4)] == line["contacts"]


@pytest.mark.parametrize(
    ("first", "code", "expected"),
    [
        (b"\xff\xff", 4400, "MESSAGE_MALFORMED"),
        ("text", 4400, "MESSAGE_MALFORMED"),
        (motion_pb2.AnimateRequest(ack=motion_pb2.Ack()).SerializeToString(), 4409, "OPEN_REQUIRED"),
        (
            motion_pb2.AnimateRequest(open=motion_pb2.Open(session="sessions/none")).SerializeToString(),
            4404,
            "SESSION_NOT_FOUND",
        ),
    ],
)
async def test_websocket_closes_with_the_tables_reason(stub, motion_addresses, first, code, expected):
    session = await create(stub)
    async with websockets.connect(websocket_address(motion_addresses, session)) as socket:
        await socket.send(first)
        with pytest.raises(websockets.ConnectionClosedError) as caught:
            await socket.recv()
    assert (caught.value.rcvd.code, caught.value.rcvd.reason) == (code, expected)


async def test_a_foreign_web_page_gets_no_websocket(stub, motion_addresses):
    address = websocket_address(motion_addresses, await create(stub))
    with pytest.raises(websockets.InvalidStatus) as caught:
        await websockets.connect(address, origin="https://example.org")
    assert caught.value.response.status_code == 403
    async with websockets.connect(address, origin="http://localhost:3000"):
        pass


async def test_websocket_takes_controls(stub, motion_addresses):
    session = await create(stub)
    async with websockets.connect(websocket_address(motion_addresses, session)) as socket:
        opening = motion_pb2.Open(pacing=motion_pb2.PACING_CREDIT)
        await socket.send(motion_pb2.AnimateRequest(open=opening).SerializeToString())
        await socket.recv()
        control = motion_pb2.ControlInput(control_id=1, steer=motion_pb2.Steer(velocity_x=1))
        await socket.send(motion_pb2.AnimateRequest(control=control).SerializeToString())
        event = motion_pb2.AnimateResponse.FromString(await socket.recv()).event
        assert event.type == motion_pb2.EVENT_TYPE_CONTROL_APPLIED


def websocket_address(addresses, session):
    return f"{addresses.http.replace('http', 'ws')}/v1/{session.name}/stream"


async def test_the_skeleton_is_served_beside(stub, motion_addresses):
    async with grpc.aio.insecure_channel(motion_addresses.grpc) as channel:
        skeletons = skeleton_pb2_grpc.SkeletonServiceStub(channel)
        default = await skeletons.GetSkeleton(skeleton_pb2.GetSkeletonRequest())
        by_id = await skeletons.GetSkeleton(skeleton_pb2.GetSkeletonRequest(skeleton=default.skeleton.id))
        listed = await skeletons.ListSkeletons(skeleton_pb2.ListSkeletonsRequest())
        with pytest.raises(grpc.aio.AioRpcError) as caught:
            await skeletons.GetSkeleton(skeleton_pb2.GetSkeletonRequest(skeleton="sha256:none"))
    assert default == by_id
    assert default.body
    assert [skeleton.id for skeleton in listed.skeletons] == [default.skeleton.id]
    assert reason(caught.value) == "SKELETON_NOT_FOUND"


async def test_draining_ends_streams_on_every_transport(motion_service):
    server = Server([motion_service], MotionSettings())
    await server.open()
    await server.load()
    async with grpc.aio.insecure_channel(server.addresses.grpc) as channel:
        stub = motion_pb2_grpc.MotionServiceStub(channel)
        session = await create(stub)
        opening = motion_pb2.Open(session=session.name, pacing=motion_pb2.PACING_CREDIT)
        watching = stub.WatchFrames(motion_pb2.WatchFramesRequest(open=opening))
        await watching.read()
        async with websockets.connect(websocket_address(server.addresses, session)) as socket:
            await socket.send(motion_pb2.AnimateRequest(open=opening).SerializeToString())
            await socket.recv()
            closing = asyncio.create_task(server.close(10))
            told = [(await watching.read()).message, motion_pb2.AnimateResponse.FromString(await socket.recv())]
            assert [message.event.type for message in told] == [motion_pb2.EVENT_TYPE_DRAINING] * 2
            assert told[0].event.reconnect_within.seconds == 10
            assert await watching.read() is grpc.aio.EOF
            with pytest.raises(websockets.ConnectionClosedOK):
                await socket.recv()
        await closing


async def test_a_reader_that_stalls_and_acknowledges_is_not_flooded(stub):
    session = await create(stub)
    call = stub.Animate()
    await call.write(motion_pb2.AnimateRequest(open=motion_pb2.Open(session=session.name)))
    await call.read()
    await call.write(motion_pb2.AnimateRequest(ack=motion_pb2.Ack()))
    name = motion_pb2.GetSessionRequest(name=session.name)
    while (await stub.GetSession(name)).session.last_sequence < 40:  # the reader stalls, the session goes on
        await asyncio.sleep(0.05)
    head = (await stub.GetSession(name)).session.last_sequence
    stale = 0
    while (frame := (await call.read()).frame).sequence < head:
        if frame.sequence:
            stale += 1
            await call.write(motion_pb2.AnimateRequest(ack=motion_pb2.Ack(sequence=frame.sequence)))
    assert stale <= MotionSettings().ack_window + 1
    call.cancel()
