"""What one caller may do to a server, and what its other callers notice of it: nothing."""

import asyncio
from contextlib import contextmanager

import numpy as np
import pytest
from prometheus_client import CollectorRegistry
from roam_character.volume import Volume
from roam_motion.control.intent import Goal, Steer
from roam_motion.control.plausibility import ImplausibleGoalError, UnreachableGoalError
from roam_motion.errors import CONTROL_BUDGET, GOAL_INVALID, GOAL_UNREACHABLE, SESSION_NOT_FOUND, SESSION_QUOTA
from roam_motion.session.application import MotionApplication
from roam_motion.session.records import ControlChange, ControlRequest, Event, EventKind, SessionRequest
from roam_motion.session.session import FrameRecord
from roam_motion.session.store.memory import MemoryStore
from roam_motion.session.stream import Pacing, StreamOptions
from roam_motion.settings import MotionSettings
from roam_serving.access import CALLER, OWNER
from roam_serving.errors import RATE_LIMITED, ServiceError
from standing import seated_pose
from walker import Place, Walker

NOISE = np.random.default_rng(1)


def application_of(**settings):
    options = {name: settings.pop(name) for name in ("check_goal", "store", "on_failure", "frames") if name in settings}
    return MotionApplication(
        Walker(),
        Walker.skeleton,
        MotionSettings(session_lease=5.0, **settings),
        CollectorRegistry(),
        restore=Place.joined,
        **options,
    )


@contextmanager
def as_caller(name):
    tokens = CALLER.set(name), OWNER.set(name)
    yield
    CALLER.reset(tokens[0])
    OWNER.reset(tokens[1])


async def refused(call):
    with pytest.raises(ServiceError) as caught:
        await call
    return caught.value


def steering(number, x=1.0):
    return ControlRequest(number, ControlChange(Steer(np.float32([x, 0.0]))))


def large_goal(ahead=0.0):
    """A goal whose furniture does not compress: about 28 kB."""
    values = NOISE.integers(-127, 127, (30, 31, 30)).astype(np.int8)
    volume = Volume(np.zeros(3, np.float32), 0.04, 0.0, values)
    return ControlChange(Goal(seated_pose(ahead=ahead), volume=volume), "large")


async def test_of_the_controls_of_one_frame_the_newest_is_kept_and_every_id_answered():
    application = application_of(controls_per_second=1e6)
    await application.ownership.renew()
    session = await application.create_session(SessionRequest())
    for number in range(1, 501):
        assert await application.control(session.name, steering(number, number / 500)) == 1
    assert len(session._schedule) == 1
    assert [await application.control(session.name, steering(number)) for number in (1, 250, 500)] == [1, 1, 1]
    stored = application.ownership._store._sessions[session.name]
    assert len(stored.controls) == 1
    await application.ticker.step([session])
    assert session.intent.velocity[0] == 1.0


async def test_pausing_and_steering_at_one_frame_both_count():
    application = application_of()
    await application.ownership.renew()
    session = await application.create_session(SessionRequest())
    await application.control(session.name, steering(1))
    await application.control(session.name, ControlRequest(2, ControlChange(paused=True)))
    (entry,) = application.ownership._store._sessions[session.name].controls.values()
    assert (entry.change.paused, type(entry.change.intent), entry.earlier) == (True, Steer, (1,))
    await application.control(session.name, ControlRequest(3, ControlChange(paused=False)))
    await application.ticker.step([session])
    assert isinstance(session.intent, Steer)


async def test_a_session_that_is_told_too_much_is_refused_and_goes_on_later():
    application = application_of(control_bytes=1 << 17, history_frames=30, snapshot_frames=1, controls_per_second=1e6)
    await application.ownership.renew()
    session = await application.create_session(SessionRequest())

    async def tell(number):
        await application.control(session.name, ControlRequest(number, large_goal()))
        await application.ticker.step([session])

    for number in range(1, 5):
        await tell(number)
    error = await refused(tell(5))
    assert (error.kind, error.retry_after) == (CONTROL_BUDGET, 1.0)
    for _ in range(32):
        await application.ticker.step([session])
    await tell(6)


async def test_a_caller_has_one_budget_for_all_of_its_sessions_and_others_have_their_own():
    application = application_of(caller_bytes=1 << 17, control_bytes=1 << 17)
    await application.ownership.renew()
    with as_caller("greedy"):
        sessions = [await application.create_session(SessionRequest()) for _ in range(5)]
        for session in sessions[:4]:
            await application.control(session.name, ControlRequest(1, large_goal()))
        error = await refused(application.control(sessions[4].name, ControlRequest(1, large_goal())))
        assert error.kind is CONTROL_BUDGET
    with as_caller("modest"):
        session = await application.create_session(SessionRequest())
        await application.control(session.name, ControlRequest(1, large_goal()))


async def test_controls_have_a_rate_inside_streams_too():
    application = application_of(controls_per_second=10)
    await application.ownership.renew()
    session = await application.create_session(SessionRequest())
    for number in range(1, 21):  # as many as may come at once
        await application.control(session.name, steering(number))
    assert (await refused(application.control(session.name, steering(21)))).kind is RATE_LIMITED


async def test_a_goal_sent_again_takes_no_further_memory():
    application = application_of(controls_per_second=1e6)
    await application.ownership.renew()
    first = large_goal()
    sessions = [await application.create_session(SessionRequest()) for _ in range(3)]
    for session in sessions:
        volume = first.intent.volume
        copy = Volume(volume.origin.copy(), volume.pitch, volume.yaw, volume.values.copy())
        goal = Goal(first.intent.pose, volume=copy)
        await application.control(session.name, ControlRequest(1, ControlChange(goal, "large")))
        await application.ticker.step([session])
    assert len({id(session.intent) for session in sessions}) == 1


async def test_a_caller_may_have_so_many_sessions():
    application = application_of(caller_sessions=2)
    await application.ownership.renew()
    with as_caller("one"):
        for _ in range(2):
            await application.create_session(SessionRequest())
        assert (await refused(application.create_session(SessionRequest()))).kind is SESSION_QUOTA
    with as_caller("other"):
        await application.create_session(SessionRequest())


async def test_a_store_that_is_nearly_full_refuses_newcomers_and_keeps_who_is_there():
    store = MemoryStore()
    application = application_of(store=store)
    await application.ownership.renew()
    session = await application.create_session(SessionRequest())
    store.nearly_full = True
    assert (await refused(application.create_session(SessionRequest()))).kind is SESSION_QUOTA
    assert (await refused(application.control(session.name, ControlRequest(1, large_goal())))).kind is CONTROL_BUDGET
    await application.control(session.name, steering(2))
    await application.ticker.step([session])
    assert session.sequence == 1


async def test_a_session_belongs_to_the_key_that_made_it():
    application = application_of()
    await application.ownership.renew()
    with as_caller("studio"):
        session = await application.create_session(SessionRequest(request_id="mine"))
        name = session.name
    with as_caller("guest"):
        for call in (
            application.get_session(name),
            application.delete_session(name),
            application.control(name, steering(1)),
        ):
            assert (await refused(call)).kind is SESSION_NOT_FOUND
        with pytest.raises(ServiceError):
            async with application.stream(name, StreamOptions()):
                pass
        assert application.list_sessions(0, "") == ([], "")
        assert (await application.create_session(SessionRequest(request_id="mine"))).name != name
    with as_caller("studio"):
        assert application.list_sessions(0, "")[0] == [session]
        assert (await application.create_session(SessionRequest(request_id="mine"))) is session


async def test_a_goal_that_cannot_be_is_refused_with_its_field_and_changes_nothing():
    def check(goal, start):
        raise error

    application = application_of(check_goal=check)
    await application.ownership.renew()
    session = await application.create_session(SessionRequest())
    for error, kind, field in (
        (ImplausibleGoalError("volume", "it has left"), GOAL_INVALID, "control.goal.volume"),
        (UnreachableGoalError("shut off"), GOAL_UNREACHABLE, "control.goal.obstacles"),
    ):
        told = await refused(application.control(session.name, ControlRequest(1, large_goal())))
        assert (told.kind, told.field, told.detail) == (kind, field, str(error))
    assert session.last_control_id == 0


async def test_who_comes_to_a_taken_seat_is_warned():
    application = application_of()
    await application.ownership.renew()
    first, second = [await application.create_session(SessionRequest()) for _ in range(2)]
    goal = large_goal()
    await application.control(first.name, ControlRequest(1, goal))
    await application.ticker.step([first])
    async with application.stream(second.name, StreamOptions()) as stream:
        await application.control(second.name, ControlRequest(1, goal))
        items = [await anext(stream) for _ in range(3)]
    warnings = [item for item in items if isinstance(item, Event) and item.kind is EventKind.WARNING]
    assert [(warning.reason, first.name in warning.message) for warning in warnings] == [("SEAT_TAKEN", True)]


async def test_the_ticker_outlives_a_step_that_fails_as_a_whole():
    """What is mended goes on; a part that stays broken makes the process say that only a restart helps."""
    failures, broken = [], True

    def frames(states, intents):
        if broken:
            raise RuntimeError("no process to be had")
        return [[step] for step in Walker().step(states, [of_one[0] for of_one in intents])]

    application = application_of(frames=frames, on_failure=failures.append)
    application.ticker._interval = 0.001
    await application.start()
    session = await application.create_session(SessionRequest())
    async with application.stream(session.name, StreamOptions(pacing=Pacing.BURST)) as stream:
        await anext(stream)
        while not failures:
            await asyncio.sleep(0.01)
        assert "no process to be had" in failures[0]
        broken = False
        application.ticker.wake()
        frame = await asyncio.wait_for(anext(stream), 5)
        assert isinstance(frame, FrameRecord)
    await application.close()


@pytest.mark.parametrize("token", [True, False])
async def test_a_stream_is_resumed_by_session_and_sequence_alone(token):
    """At another replica, which has to compute frames again that the reader had: with a token or without."""
    store = MemoryStore()
    first, second = application_of(store=store), application_of(store=store)
    await first.ownership.renew()
    session = await first.create_session(SessionRequest())
    await first.control(session.name, steering(1))
    for _ in range(20):
        await first.ticker.step([session])
    await first.control(session.name, steering(2, 0.5))
    store._leases.clear()
    await second.ownership.renew()
    options = StreamOptions(
        pacing=Pacing.BURST, after_sequence=20, resume_token=session.record.resume_token if token else ""
    )
    async with second.stream(session.name, options) as stream:
        again = second.sessions.get(session.name)
        while again.sequence < 24:
            await second.ticker.step([again])
        items = [stream.next() for _ in range(8)]
    events = [item for item in items if isinstance(item, Event) and item.kind is EventKind.CONTROL_APPLIED]
    frames = [item.sequence for item in items if isinstance(item, FrameRecord)]
    assert [(event.control_id, event.sequence) for event in events] == [(2, 21)]
    assert frames[:3] == [21, 22, 23]


async def test_steering_that_nobody_can_walk_is_cut_and_said_so():
    application = application_of()
    await application.ownership.renew()
    session = await application.create_session(SessionRequest())
    async with application.stream(session.name, StreamOptions()) as stream:
        await application.control(session.name, steering(1, 1.0))
        await application.control(session.name, steering(2, 8.0))
        items = [await anext(stream) for _ in range(4)]
    warnings = [item for item in items if isinstance(item, Event) and item.kind is EventKind.WARNING]
    assert [warning.reason for warning in warnings] == ["SPEED_CUT"]
    assert "m/s" in warnings[0].message
