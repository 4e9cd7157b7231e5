"""Pacing: what a reader gets when it is fast, slow, late, or comes back."""

import asyncio

import pytest
from prometheus_client import CollectorRegistry
from requests_of import playback, steer
from roam.v1 import skeleton_pb2
from roam_motion.api.messages import Following, FrameFormat, response
from roam_motion.errors import SEQUENCE_AHEAD
from roam_motion.session.application import MotionApplication
from roam_motion.session.records import EventKind, SessionRequest
from roam_motion.session.session import FrameRecord
from roam_motion.session.stream import Pacing, StreamOptions, StreamStart
from roam_motion.settings import MotionSettings
from roam_serving.errors import ServiceError
from walker import Place, Walker

REALTIME, CREDIT, BURST = Pacing.REALTIME, Pacing.CREDIT, Pacing.BURST
SKIPPED = EventKind.FRAMES_SKIPPED
APPLIED = EventKind.CONTROL_APPLIED
ENDED = EventKind.SESSION_ENDED


@pytest.fixture
async def application():
    """An application whose ticker does not run: tests step by hand."""
    settings = MotionSettings(ring_frames=8, burst_frames=3, ack_window=4)
    application = MotionApplication(
        Walker(),
        Walker.skeleton,
        settings,
        CollectorRegistry(),
        restore=Place.joined,
    )
    await application.ownership.renew()
    yield application
    await application.close()


@pytest.fixture
async def session(application):
    return await application.create_session(SessionRequest())


async def step(application, session, count=1):
    for _ in range(count):
        await application.ticker.step([session])


async def take(stream):
    """Everything the reader can have right now: frames as numbers, events as (type, sequence)."""
    taken = []
    while True:
        try:
            item = await asyncio.wait_for(anext(stream), 0.01)
        except (TimeoutError, StopAsyncIteration):
            return taken
        if isinstance(item, FrameRecord):
            taken.append(item.sequence)
        elif isinstance(item, StreamStart):
            taken.append(("start", item.first_sequence, item.discontinuity))
        else:
            taken.append((item.kind, item.sequence))


def opening(session, pacing, **fields):
    return session.name, StreamOptions(pacing, **fields)


async def test_realtime_gives_the_newest_frame_and_says_what_was_skipped(application, session):
    await step(application, session, 2)
    async with application.stream(*opening(session, REALTIME)) as stream:
        assert await take(stream) == [("start", 3, False)]
        await step(application, session)
        assert await take(stream) == [3]
        await step(application, session, 20)
        assert await take(stream) == [(SKIPPED, 23), 23]
        await step(application, session)
        assert await take(stream) == [24]


async def test_the_skipped_count_is_exact(application, session):
    async with application.stream(*opening(session, REALTIME)) as stream:
        await anext(stream)
        await step(application, session, 5)
        event = await anext(stream)
    assert event.skipped_count == 4


async def test_a_reader_that_acknowledges_gets_a_window(application, session):
    async with application.stream(*opening(session, REALTIME)) as stream:
        stream.acknowledge(0, 0)
        taken = await take(stream)
        for _ in range(10):
            await step(application, session)
            taken += await take(stream)
        assert taken == [("start", 1, False), 1, 2, 3, 4]
        stream.acknowledge(4, 0)
        assert await take(stream) == [(SKIPPED, 10), 10]


async def test_realtime_after_a_break_gets_what_it_missed_then_the_newest(application, session):
    await step(application, session, 6)
    async with application.stream(*opening(session, REALTIME, after_sequence=3)) as stream:
        assert await take(stream) == [("start", 4, False), 4, 5, 6]


async def test_credit_moves_the_session_exactly_as_far_as_granted(application, session):
    async with application.stream(*opening(session, CREDIT, credit=2)) as stream:
        taken = [*await take(stream)]
        while session.wants(tick=True):
            await step(application, session)
            taken += await take(stream)
        assert taken == [("start", 1, False), 1, 2]
        stream.acknowledge(2, 3)
        while session.wants(tick=False):
            await step(application, session)
        assert await take(stream) == [3, 4, 5]
        assert session.sequence == 5


async def test_burst_runs_ahead_of_its_reader_only_as_far_as_allowed(application, session):
    async with application.stream(*opening(session, BURST)) as stream:
        assert await take(stream) == [("start", 1, False)]
        while session.wants(tick=False):
            await step(application, session)
        assert session.sequence == 3
        assert await take(stream) == [1, 2, 3]
        assert session.wants(tick=False)


async def test_no_frame_is_skipped_for_the_slower_of_two_bakers(application, session):
    async with (
        application.stream(*opening(session, BURST)) as fast,
        application.stream(*opening(session, BURST)) as slow,
    ):
        taken = []
        for _ in range(50):
            if session.wants(tick=False):
                await step(application, session)
            taken += await take(fast)
        assert session.sequence == 7  # the ring holds 8
        assert await take(slow) == [("start", 1, False), 1, 2, 3, 4, 5, 6, 7]


async def test_resume_from_the_ring_is_seamless_and_says_when_it_is_not(application, session):
    await step(application, session, 10)  # the ring keeps 3..10
    async with application.stream(*opening(session, BURST, after_sequence=5)) as stream:
        assert await take(stream) == [("start", 6, False), 6, 7, 8, 9, 10]
    async with application.stream(*opening(session, BURST, after_sequence=1)) as stream:
        assert await take(stream) == [("start", 3, True), 3, 4, 5, 6, 7, 8, 9, 10]


async def test_a_stream_cannot_start_in_the_future_or_with_a_foreign_token(application, session):
    with pytest.raises(ServiceError) as caught:
        async with application.stream(*opening(session, BURST, after_sequence=1)):
            pass
    assert caught.value.kind is SEQUENCE_AHEAD
    with pytest.raises(ServiceError) as caught:
        async with application.stream(*opening(session, BURST, resume_token="other")):
            pass
    assert caught.value.field == "open.resume_token"
    async with application.stream(*opening(session, BURST, resume_token=session.record.resume_token)):
        pass


async def test_nobody_watching_nobody_moving(application, session):
    assert not session.wants(tick=True)
    async with application.stream(*opening(session, REALTIME)):
        assert session.wants(tick=True)
        assert not session.wants(tick=False)
        await application.control(session.name, playback(1, paused=True))
        assert not session.wants(tick=True)
        await application.control(session.name, playback(2, paused=False))
        assert session.wants(tick=True)
    assert not session.wants(tick=True)


async def test_controls_are_confirmed_on_every_stream(application, session):
    async with application.stream(*opening(session, BURST)) as stream:
        await take(stream)
        await application.control(session.name, steer(9))
        assert await take(stream) == [(APPLIED, 1)]


async def test_deleting_a_session_ends_its_streams(application, session):
    async with application.stream(*opening(session, BURST)) as stream:
        await take(stream)
        await application.delete_session(session.name)
        assert await take(stream) == [(ENDED, 0)]
        with pytest.raises(StopAsyncIteration):
            await anext(stream)


async def test_draining_tells_readers_and_takes_no_more(application, session):
    async with application.stream(*opening(session, REALTIME)) as stream:
        await take(stream)
        await application.drain()
        assert await take(stream) == [(EventKind.DRAINING, 0)]
    with pytest.raises(ServiceError) as caught:
        async with application.stream(*opening(session, REALTIME)):
            pass
    assert caught.value.kind.reason == "DRAINING"


async def test_many_readers_share_one_packing(application, session):
    async with (
        application.stream(*opening(session, BURST)) as one,
        application.stream(*opening(session, BURST)) as two,
    ):
        await take(one)
        await take(two)
        await step(application, session)
        skeleton = skeleton_pb2.Skeleton(id="s")
        frames = [response(stream, await anext(stream), Following(FrameFormat()), skeleton) for stream in (one, two)]
    assert frames[0] == frames[1]
    assert len(session.ring[0].packed) == 1
