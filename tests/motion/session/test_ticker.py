"""One batched step for all sessions that are due; one bad session does not stop the others."""

import asyncio
import threading

import numpy as np
import pytest
from prometheus_client import CollectorRegistry
from requests_of import steer
from roam_motion.session.application import MotionApplication
from roam_motion.session.records import EventKind, SessionRequest
from roam_motion.session.session import FrameRecord
from roam_motion.session.stream import Pacing, StreamOptions
from roam_motion.session.ticker import Pace
from roam_motion.settings import MotionSettings
from walker import Place, Walker


@pytest.fixture
def walker():
    return Walker()


@pytest.fixture
async def application(walker):
    application = MotionApplication(
        walker,
        Walker.skeleton,
        MotionSettings(burst_frames=4),
        CollectorRegistry(),
        restore=Place.joined,
    )
    await application.ownership.renew()
    yield application
    await application.close()


async def create(application, **fields):
    return await application.create_session(SessionRequest(**fields))


def burst(session):
    return session.name, StreamOptions(Pacing.BURST)


async def frames(stream, count):
    taken = []
    async for item in stream:
        if isinstance(item, FrameRecord):
            taken.append(item)
            if len(taken) == count:
                return taken
    return taken


async def test_sessions_that_are_due_share_one_batch(application, walker):
    sessions = [await create(application, seed=seed) for seed in range(5)]
    await application.ticker.step(sessions)
    assert walker.batches == [5]
    assert [session.sequence for session in sessions] == [1] * 5


async def test_the_running_ticker_feeds_many_readers(application, walker):
    sessions = [await create(application) for _ in range(6)]
    await application.start()

    async def read(session):
        async with application.stream(*burst(session)) as stream:
            return [record.sequence for record in await frames(stream, 20)]

    for sequences in await asyncio.gather(*(read(session) for session in sessions)):
        assert sequences == list(range(1, 21))
    assert max(walker.batches) > 1


async def test_realtime_ticks_by_itself(application):
    session = await create(application)
    await application.start()
    async with application.stream(session.name, StreamOptions()) as stream:
        taken = await frames(stream, 3)
    assert taken[0].sequence == 1
    assert [record.sequence for record in taken] == sorted({record.sequence for record in taken})


async def test_a_failing_session_ends_alone(application, walker):
    walker.poisoned_seed = 13
    good, bad = await create(application, seed=1), await create(application, seed=13)
    async with application.stream(*burst(bad)) as stream:
        await anext(stream)
        await application.ticker.step([good, bad])
        event = await anext(stream)
    assert event.kind is EventKind.SESSION_ENDED
    assert "ArithmeticError" in event.message
    assert good.sequence == 1
    assert [session.name for session in application.sessions] == [good.name]


async def test_a_session_deleted_during_its_step_stays_deleted(application, walker):
    walker.gate = threading.Event()
    session = await create(application)
    stepping = asyncio.create_task(application.ticker.step([session]))
    await asyncio.sleep(0)
    await application.delete_session(session.name)
    walker.gate.set()
    await stepping
    assert session.sequence == 0


async def test_frames_do_not_depend_on_who_else_is_stepped(application):
    alone, together = await create(application, seed=1), await create(application, seed=1)
    for session in (alone, together):
        await application.control(session.name, steer(1, 1.0, 0.5))
    others = [await create(application, seed=seed) for seed in range(2, 6)]
    for _ in range(5):
        await application.ticker.step([alone])
        await application.ticker.step([*others, together])
    for one, two in zip(alone.ring, together.ring, strict=True):
        assert one.data.root_position.tobytes() == two.data.root_position.tobytes()


def test_frames_are_shown_evenly_however_long_steps_take():
    taken = np.random.default_rng(0).uniform(0.004, 0.008, 600)
    pace = Pace(most=0.02)
    shown = np.array([duration + pace.wait(duration) for duration in taken])[300:]
    assert shown.std() < 0.3 * taken.std()
    assert shown.max() <= 0.0081  # nobody waits longer than slow steps take
    assert pace.wait(0.5) == 0.0  # what is late is shown at once
    assert pace.after <= 0.02
