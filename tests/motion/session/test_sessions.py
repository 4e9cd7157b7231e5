"""Sessions: idempotent creation, control cursor, leases, quota, goal events."""

import numpy as np
import pytest
from prometheus_client import CollectorRegistry
from requests_of import steer
from roam.v1 import motion_pb2, skeleton_pb2
from roam_motion.animator import Idle, Steer
from roam_motion.api.messages import control_request, session_request
from roam_motion.errors import SESSION_NOT_FOUND, SESSION_QUOTA
from roam_motion.session.application import MotionApplication
from roam_motion.session.records import SessionRequest
from roam_motion.session.session import ArrivalDetector
from roam_motion.session.stream import StreamOptions
from roam_motion.settings import MotionSettings
from roam_serving.errors import ServiceError
from walker import Place, Walker


class Clock:
    now = 1000.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
async def application(clock):
    settings = MotionSettings(max_sessions=3, idle_timeout=60)
    application = MotionApplication(
        Walker(),
        Walker.skeleton,
        settings,
        CollectorRegistry(),
        clock=clock,
        restore=Place.joined,
    )
    await application.ownership.renew()
    yield application
    await application.close()


async def create(application, **fields):
    return await application.create_session(SessionRequest(**fields))


async def create_by_message(application, **fields):
    message = motion_pb2.CreateSessionRequest(**fields)
    return await application.create_session(session_request(message, application.skeleton))


async def control_by_message(application, session, message):
    return await application.control(session.name, control_request(message, application.skeleton))


def steering(x=1.0, **fields):
    return motion_pb2.ControlInput(control_id=1, steer=motion_pb2.Steer(velocity_x=x, **fields))


async def refusal(function, *arguments, **fields):
    with pytest.raises(ServiceError) as caught:
        await function(*arguments, **fields)
    return caught.value


async def test_the_same_request_id_gives_the_same_session(application):
    first = await create(application, request_id="a")
    assert await create(application, request_id="a") is first
    assert await create(application, request_id="b") is not first
    await application.delete_session(first.name)
    assert await create(application, request_id="a") is not first


async def test_a_deleted_session_is_gone(application):
    name = (await create(application)).name
    await application.delete_session(name)
    assert (await refusal(application.get_session, name)).kind is SESSION_NOT_FOUND
    assert (await refusal(application.delete_session, name)).kind is SESSION_NOT_FOUND


async def test_idle_sessions_are_reclaimed_and_connected_ones_kept(application, clock):
    idle, watched = await create(application), await create(application)
    async with application.stream(watched.name, StreamOptions()):
        clock.now += 59
        application.ticker.sweep()
        assert len(application.sessions) == 2
        assert idle.expire_time == 1060
        clock.now += 2
        application.ticker.sweep()
        assert [session.name for session in application.sessions] == [watched.name]
    clock.now += 59
    assert await application.get_session(watched.name)  # a question counts as a client
    clock.now += 59
    application.ticker.sweep()
    assert len(application.sessions) == 1


async def test_the_quota_counts_live_sessions_only(application, clock):
    for _ in range(3):
        await create(application)
    error = await refusal(create, application)
    assert error.kind is SESSION_QUOTA
    assert error.retry_after == 60
    clock.now += 61
    assert await create(application)
    assert len(application.sessions) == 1


async def test_sessions_are_listed_in_pages(application):
    names = [(await create(application)).name for _ in range(3)]
    page, token = application.list_sessions(2, "")
    rest, end = application.list_sessions(2, token)
    assert [session.name for session in page + rest] == names
    assert end == ""
    with pytest.raises(ServiceError) as caught:
        application.list_sessions(2, "x")
    assert caught.value.field == "page_token"


async def test_a_repeated_control_changes_nothing_and_gets_the_first_answer(application):
    session = await create(application)
    assert await application.control(session.name, steer(1)) == 1
    session.sequence = 7
    assert await application.control(session.name, steer(2, x=2.0)) == 8
    assert await application.control(session.name, steer(1, x=3.0)) == 1
    assert isinstance(session.intents(1)[0], Steer)
    assert session.intents(1)[0].velocity[0] == 2.0
    assert session.last_control_id == 2


async def test_a_control_during_a_step_affects_the_frame_after_it(application):
    session = await create(application)
    session.under_way = 1
    assert await application.control(session.name, steer(1)) == 2


async def test_control_id_0_takes_the_next_free_one(application):
    session = await create(application)
    await application.control(session.name, steer(4))
    await application.control(session.name, steer(0, x=2.0))
    assert session.last_control_id == 5


async def test_standing_still_is_idle(application):
    session = await create(application)
    await application.control(session.name, steer(2))
    await control_by_message(application, session, motion_pb2.ControlInput(steer=motion_pb2.Steer()))
    assert isinstance(session.intents(1)[0], Idle)


@pytest.mark.parametrize(
    ("control", "field"),
    [
        (motion_pb2.ControlInput(control_id=1), "control.input"),
        (steering(x=float("nan")), "control.steer.velocity_x"),
        (steering(x=50.0), "control.steer.velocity_x"),
        (steering(facing=float("inf")), "control.steer.facing"),
        (steering(action=skeleton_pb2.ACTION_SIT), "control.steer.action"),
        (motion_pb2.ControlInput(goal=motion_pb2.Goal(action=skeleton_pb2.ACTION_WALK)), "control.goal.action"),
        (motion_pb2.ControlInput(goal=motion_pb2.Goal(action=skeleton_pb2.ACTION_SIT)), "control.goal.pose"),
    ],
)
async def test_a_bad_control_names_its_field_and_leaves_the_session_alone(application, control, field):
    session = await create(application)
    assert (await refusal(control_by_message, application, session, control)).field == field
    assert session.last_control_id == 0
    assert isinstance(session.intents(1)[0], Idle)


@pytest.mark.parametrize(
    "pose",
    [
        skeleton_pb2.Pose(root_position=b"\0" * 12, rotations=b"\0" * 5),
        skeleton_pb2.Pose(root_position=b"\0" * 8, rotations=b"\0" * 22 * 16),
        skeleton_pb2.Pose(root_position=b"\0" * 12, rotations=b"\0" * 22 * 16),
        skeleton_pb2.Pose(root_position=b"\xff" * 12, rotations=b"\0" * 22 * 16),
        skeleton_pb2.Pose(skeleton_id="sha256:other", root_position=b"\0" * 12, rotations=b"\0" * 22 * 16),
    ],
    ids=["rotations cut", "position cut", "not unit", "not finite", "other skeleton"],
)
async def test_a_bad_goal_pose_is_refused(application, pose):
    session = await create(application)
    goal = motion_pb2.Goal(pose=pose, action=skeleton_pb2.ACTION_SIT)
    error = await refusal(control_by_message, application, session, motion_pb2.ControlInput(goal=goal))
    assert error.field.startswith("control.goal.pose")


async def test_creation_checks_its_numbers(application):
    nan = float("nan")
    assert (await refusal(create_by_message, application, floor_height=nan)).field == "floor_height"
    place = motion_pb2.Placement(x=1e9)
    assert (await refusal(create_by_message, application, start_placement=place)).field == "start_placement.x"
    assert (await refusal(create, application, request_id="x" * 65)).field == "request_id"
    assert (await refusal(create, application, skeleton_id="sha256:other")).field == "skeleton_id"
    assert len(application.sessions) == 0


async def test_start_from_a_pose_takes_its_place(application):
    walker = Walker()
    rotations = walker.skeleton.rest_rotations.astype("<f4").tobytes()
    pose = skeleton_pb2.Pose(root_position=np.array([2, 0.9, -1], "<f4").tobytes(), rotations=rotations)
    session = await create_by_message(application, start_pose=pose)
    assert session.state.position == (2.0, -1.0)


def test_a_goal_is_reached_once_when_near_and_still():
    arrival = ArrivalDetector(tolerance=0.05)
    approach = [1.0, 0.5, 0.04, 0.02] + [0.01] * 30
    assert [i for i, distance in enumerate(approach) if arrival.reached(distance)] == [14]
    arrival.restart()
    assert not any(arrival.reached(0.2) for _ in range(30))
    assert not any(arrival.reached(None) for _ in range(30))
