import grpc
import numpy as np
import pytest
from fake_services import FRAMES_TO_GOAL, Fake
from roam.v1 import motion_pb2
from roam_client import (
    Action,
    AsyncClient,
    Client,
    ConnectionFailedError,
    Event,
    EventType,
    Frame,
    NotFoundError,
    Placement,
    controls,
)


def take(stream, count: int) -> list[Frame]:
    frames = []
    for frame in stream.frames():
        frames.append(frame)
        if len(frames) == count:
            break
    return frames


@pytest.mark.parametrize("encoding", ["float32", "snorm16"])
@pytest.mark.parametrize("pacing", ["realtime", "credit", "burst"])
def test_frames_come_in_order_and_decoded(client: Client, encoding: str, pacing: str):
    with (
        client.create_session(Placement(1, 2, 0.5), floor_height=0.1) as session,
        session.stream(pacing=pacing, encoding=encoding) as stream,
    ):
        frames = take(stream, 5)
    assert [f.sequence for f in frames] == [1, 2, 3, 4, 5]
    assert stream.header.frame_rate == 30
    np.testing.assert_allclose(frames[0].root_position, [1, 1.0, 2], atol=1e-6)
    np.testing.assert_allclose(frames[0].joint_positions[2], [1, 1.7, 2], atol=1e-6)
    np.testing.assert_allclose(frames[0].rotations, [[0, 0, 0, 1]] * 3, atol=1e-6)
    assert frames[0].contacts.tolist() == [True, False, True, False]
    assert frames[0].action is Action.IDLE
    assert frames[0].goal_distance is None


def test_leaving_the_session_deletes_it(client: Client, fake: Fake):
    with client.create_session(seed=5, idle_timeout=2.5, request_id="r") as session:
        created = fake.motions.created[-1]
        assert (created.seed, created.request_id, created.idle_timeout.ToTimedelta().total_seconds()) == (5, "r", 2.5)
        assert not created.HasField("start_placement")
        assert client.session(session.name).frame_rate == 30
    assert fake.motions.deleted == [session.name]
    session.delete()  # a second time is no error


@pytest.mark.parametrize(
    "end", ["UNAVAILABLE", "CANCELLED", "goodbye"]
)  # a break, a server that shuts down, its goodbye
@pytest.mark.parametrize("duplex", [True, False])
def test_a_broken_stream_goes_on_after_the_last_frame(client: Client, fake: Fake, duplex: bool, end: str):
    fake.motions.break_after, fake.motions.goodbye = 4, end == "goodbye"
    fake.motions.break_code = getattr(grpc.StatusCode, end, None)
    session = client.create_session()
    with session.stream() if duplex else session.watch() as stream:
        frames = take(stream, 11)
    assert [f.sequence for f in frames] == list(range(1, 12))
    assert [o.after_sequence for o in fake.motions.opens] == [0, 4, 8]
    assert [o.resume_token for o in fake.motions.opens] == ["", "token-1", "token-2"]
    assert [o.known_skeleton_id for o in fake.motions.opens] == ["", "sha256:fake", "sha256:fake"]


def test_controls_the_server_never_had_are_sent_again_once(client: Client, fake: Fake):
    fake.motions.break_after, fake.motions.forget_controls = 3, True
    session = client.create_session()
    character = fake.motions.characters[session.name]
    with session.stream() as stream:
        stream.send(controls.steer(1, 0))
        take(stream, 3)
        assert character.controls == {}
        fake.motions.forget_controls = False
        take(stream, 3)
        take(stream, 6)
    assert list(character.controls) == [1]


def test_a_stream_that_stays_broken_says_so(client: Client, fake: Fake):
    session = client.create_session()
    fake.motions.break_after = 2
    with session.stream(resume_for=0.1) as stream:
        take(stream, 2)
        del fake.motions.characters[session.name]
        with pytest.raises(NotFoundError):
            take(stream, 1)


async def test_no_server_to_resume_from_is_a_failed_connection():
    from fake_services import fake_services

    with fake_services() as fake:
        client = AsyncClient(motion=fake.address)
        session = await client.create_session()
        stream = session.stream(resume_for=0.1)
        await stream.__aenter__()
        fake.motions.break_after = 1
    with pytest.raises(ConnectionFailedError, match="could not be resumed"):
        async for _ in stream:
            pass
    await client.close()


def test_frames_are_acknowledged_now_and_then_in_realtime_and_not_in_burst(client: Client, fake: Fake):
    with client.create_session() as session:
        with session.stream(pacing="burst") as stream:
            take(stream, 3)
        assert fake.motions.acks == []
        with session.stream(after_sequence=3) as stream:
            take(stream, 9)
    assert fake.motions.acks[:3] == [3, 7, 11]  # the first one says that this reader acknowledges


def test_the_control_counter_is_shared_by_calls_and_streams(client: Client, fake: Fake):
    session = client.create_session()
    assert session.steer(0, 1) == 1
    with session.stream(pacing="credit") as stream:
        stream.send(controls.playback(paused=False))
        take(stream, 2)
    session.stand_up()
    assert list(fake.motions.characters[session.name].controls) == [1, 2, 3]


def test_a_new_process_does_not_reuse_control_ids(client: Client, fake: Fake):
    session = client.create_session()
    session.steer(0, 1)
    again = client.session(session.name)
    with again.stream(pacing="credit") as stream:
        stream.send(controls.steer(0, 2))
        take(stream, 2)
    assert list(fake.motions.characters[session.name].controls) == [1, 2]


def test_watching_sends_controls_as_calls(client: Client, fake: Fake):
    goal = client.synthesize("objects/sha256:abc")
    session = client.create_session()
    with session.watch() as stream:
        stream.send(controls.go_to(goal))
        items = []
        for item in stream:
            items.append(item)
            if isinstance(item, Event):
                break
    assert items[-1].type is EventType.GOAL_REACHED
    assert items[-2].goal_distance == 0


def test_events_that_are_newer_than_this_client_read_as_unspecified():
    assert Event.from_message(motion_pb2.SessionEvent(type=99)).type is EventType.UNSPECIFIED  # type: ignore[arg-type]


async def test_the_async_twin_streams_resumes_and_steers(fake: Fake):
    fake.motions.break_after = 4
    client = AsyncClient(goalpose=fake.address, motion=fake.address)
    async with client, await client.create_session() as session:
        async with session.stream(pacing="credit") as stream:
            await stream.send(controls.steer(0, 1))
            sequences = []
            async for frame in stream.frames():
                sequences.append(frame.sequence)
                if len(sequences) == 10:
                    break
        async with session.watch(after_sequence=10) as stream:
            async for frame in stream.frames():
                assert frame.sequence == 11
                break
        assert await session.stand_up() > 10
    assert sequences == list(range(1, 11))
    assert fake.motions.deleted == [session.name]


def test_the_goal_is_reached_where_the_fake_reaches_it(client: Client):
    goal = client.synthesize("objects/sha256:abc")
    motion = client.create_session(Placement(0, 3), floor_height=0.25).bake(goal, hold=0.5)
    assert motion.goal_reached is not None
    assert motion.goal_distances()[motion.goal_reached] == pytest.approx(0, abs=1e-6)
    assert motion.goal_reached in (FRAMES_TO_GOAL - 1, FRAMES_TO_GOAL)
