"""A replica dies or leaves; its sessions go on elsewhere as if nothing had happened."""

import pytest
from replicas import anyone, assert_same, unbroken, walking
from roam_client import AsyncClient, Client, EventType, Frame, NotFoundError, Placement
from roam_client.sessions.controls import steer

PLACE = (0.5, -1.0, 0.75)  # numbers that float32 holds
COUNT = 120


def collect(stream, frames, events, count):
    """Reads until frame `count`."""
    for item in stream:
        (frames if isinstance(item, Frame) else events).append(item)
        if isinstance(item, Frame) and item.sequence >= count:
            return


def applied(events):
    """First frames that the controls could affect, in order."""
    return [event.sequence for event in events if event.type is EventType.CONTROL_APPLIED]


def test_after_a_kill_the_motion_is_the_unbroken_one(pair):
    first, second = pair
    frames, events = [], []
    with Client(motion=anyone(first, second)) as client, client.create_session(Placement(*PLACE)) as session:
        started = session.steer(0.3, 1.0)
        with session.stream() as stream:
            collect(stream, frames, events, 35)
            stream.send(steer(-0.8, 0.4))
            collect(stream, frames, events, 50)
            first.kill()
            collect(stream, frames, events, COUNT)
            assert stream.header.exact
            assert not stream.header.discontinuity
    (turned,) = applied(events)
    assert_same(frames, unbroken(PLACE, {started: walking(0.3, 1.0), turned: walking(-0.8, 0.4)}, frames[-1].sequence))
    sequences = [frame.sequence for frame in frames]
    skipped = sum(event.skipped_count for event in events)
    assert sequences == sorted(set(sequences))
    assert len(sequences) + skipped == sequences[-1] - sequences[0] + 1


def test_the_process_that_steps_may_die(pair):
    first, _ = pair
    frames, events = [], []
    with Client(motion=anyone(first)) as client, client.create_session(Placement(*PLACE)) as session:
        started = session.steer(0.3, 1.0)
        with session.stream(pacing="burst") as stream:
            collect(stream, frames, events, 40)
            killed = first.kill_stepping()
            collect(stream, frames, events, COUNT)
            assert stream.header.exact
    assert killed not in first.stepping()
    assert_same(frames, unbroken(PLACE, {started: walking(0.3, 1.0)}, COUNT))
    assert [frame.sequence for frame in frames] == list(range(1, COUNT + 1))


async def test_a_replica_that_leaves_hands_its_sessions_over(pair):
    first, second = pair
    frames, events = [], []
    async with AsyncClient(motion=anyone(first, second)) as client:
        session = await client.create_session(Placement(*PLACE))
        started = await session.steer(0.0, 1.2)
        async with session.stream(pacing="burst") as stream:
            async for item in stream:
                (frames if isinstance(item, Frame) else events).append(item)
                if isinstance(item, Frame) and item.sequence == 40:
                    first.terminate()
                if len(frames) == COUNT:
                    break
            assert stream.header.exact
        await session.delete()
        with pytest.raises(NotFoundError):
            await client.session(session.name)
    assert [frame.sequence for frame in frames] == list(range(1, COUNT + 1))
    assert EventType.DRAINING in [event.type for event in events]
    assert_same(frames, unbroken(PLACE, {started: walking(0.0, 1.2)}, COUNT))
    assert first.process.wait(20) == 0


def test_a_restart_of_redis_is_only_a_pause(redis, pool):
    frames, events = [], []
    with Client(motion=pool[0].address) as client, client.create_session(Placement(*PLACE)) as session:
        started = session.steer(0.0, 1.0)
        with session.stream() as stream:
            collect(stream, frames, events, 15)
            redis.restart()
            collect(stream, frames, events, 60)
    assert frames[-1].sequence == 60
    assert_same(frames, unbroken(PLACE, {started: walking(0.0, 1.0)}, 60))


def test_a_control_written_down_before_the_kill_is_not_lost(pair):
    first, second = pair
    with Client(motion=first.address) as client:
        session = client.create_session(Placement(*PLACE))
        started = session.steer(0.0, 1.0)
        with session.stream(pacing="burst") as stream:
            early = [next(stream.frames()) for _ in range(3)]
        turned = session.steer(1.0, 0.0)
    first.kill()
    with (
        Client(motion=second.address) as client,
        client.session(session.name) as revived,
        revived.stream(pacing="burst", after_sequence=early[-1].sequence) as stream,
    ):
        late = [frame for frame, _ in zip(stream.frames(), range(turned + 5), strict=False)]
    assert late[0].sequence == early[-1].sequence + 1
    assert_same(
        early + late, unbroken(PLACE, {started: walking(0.0, 1.0), turned: walking(1.0, 0.0)}, late[-1].sequence)
    )
