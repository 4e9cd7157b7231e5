"""Sessions: idempotent creation, control cursor, leases, quota, goal events."""

import numpy as np
import pytest
from motion.application import MotionApplication
from motion.errors import SESSION_NOT_FOUND, SESSION_QUOTA
from motion.sessions import GoalWatch
from motion.settings import MotionSettings
from motion.step import Idle, Steer
from prometheus_client import CollectorRegistry
from roam.v1 import motion_pb2, skeleton_pb2
from serving.errors import ServiceError
from walker import Walker


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
        Walker(), Walker.skeleton, skeleton_pb2.Skeleton(id="s"), settings, CollectorRegistry(), clock
    )
    yield application
    await application.close()


def create(application, **fields):
    return application.create_session(motion_pb2.CreateSessionRequest(**fields))


def steer(control_id, x=1.0, **fields):
    return motion_pb2.ControlInput(control_id=control_id, steer=motion_pb2.Steer(velocity_x=x, **fields))


def refusal(function, *arguments):
    with pytest.raises(ServiceError) as caught:
        function(*arguments)
    return caught.value


def test_the_same_request_id_gives_the_same_session(application):
    first = create(application, request_id="a")
    assert create(application, request_id="a") is first
    assert create(application, request_id="b") is not first
    application.delete_session(first.name)
    assert create(application, request_id="a") is not first


def test_a_deleted_session_is_gone(application):
    name = create(application).name
    application.delete_session(name)
    assert refusal(application.get_session, name).kind is SESSION_NOT_FOUND
    assert refusal(application.delete_session, name).kind is SESSION_NOT_FOUND


def test_idle_sessions_are_reclaimed_and_connected_ones_kept(application, clock):
    idle, watched = create(application), create(application)
    with application.stream(motion_pb2.Open(session=watched.name)):
        clock.now += 59
        application.sessions.drop_expired()
        assert len(application.sessions) == 2
        assert idle.expire_time == 1060
        clock.now += 2
        application.sessions.drop_expired()
        assert [session.name for session in application.sessions] == [watched.name]
    clock.now += 59
    assert application.get_session(watched.name)  # a question counts as a client
    clock.now += 59
    application.sessions.drop_expired()
    assert len(application.sessions) == 1


def test_the_quota_counts_live_sessions_only(application, clock):
    for _ in range(3):
        create(application)
    error = refusal(create, application)
    assert error.kind is SESSION_QUOTA
    assert error.retry_after == 60
    clock.now += 61
    assert create(application)
    assert len(application.sessions) == 1


def test_sessions_are_listed_in_pages(application):
    names = [create(application).name for _ in range(3)]
    page, token = application.list_sessions(2, "")
    rest, end = application.list_sessions(2, token)
    assert [session.name for session in page + rest] == names
    assert end == ""
    assert refusal(application.list_sessions, 2, "x").field == "page_token"


def test_a_repeated_control_changes_nothing_and_gets_the_first_answer(application):
    session = create(application)
    assert application.control(session.name, steer(1)) == 1
    session.sequence = 7
    assert application.control(session.name, steer(2, x=2.0)) == 8
    assert application.control(session.name, steer(1, x=3.0)) == 1
    assert isinstance(session.intent, Steer)
    assert session.intent.velocity[0] == 2.0
    assert session.last_control_id == 2


def test_a_control_during_a_step_affects_the_frame_after_it(application):
    session = create(application)
    session.stepping = True
    assert application.control(session.name, steer(1)) == 2


def test_control_id_0_takes_the_next_free_one(application):
    session = create(application)
    application.control(session.name, steer(4))
    application.control(session.name, steer(0, x=2.0))
    assert session.last_control_id == 5


def test_standing_still_is_idle(application):
    session = create(application)
    application.control(session.name, steer(1))
    application.control(session.name, steer(2, x=0.0))
    assert isinstance(session.intent, Idle)


@pytest.mark.parametrize(
    ("control", "field"),
    [
        (motion_pb2.ControlInput(control_id=1), "control.input"),
        (steer(1, x=float("nan")), "control.steer.velocity_x"),
        (steer(1, x=50.0), "control.steer.velocity_x"),
        (steer(1, facing=float("inf")), "control.steer.facing"),
        (steer(1, action=skeleton_pb2.ACTION_SIT), "control.steer.action"),
        (motion_pb2.ControlInput(goal=motion_pb2.Goal(action=skeleton_pb2.ACTION_WALK)), "control.goal.action"),
        (motion_pb2.ControlInput(goal=motion_pb2.Goal(action=skeleton_pb2.ACTION_SIT)), "control.goal.pose"),
    ],
)
def test_a_bad_control_names_its_field_and_leaves_the_session_alone(application, control, field):
    session = create(application)
    assert refusal(application.control, session.name, control).field == field
    assert session.last_control_id == 0
    assert isinstance(session.intent, Idle)


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
def test_a_bad_goal_pose_is_refused(application, pose):
    session = create(application)
    goal = motion_pb2.Goal(pose=pose, action=skeleton_pb2.ACTION_SIT)
    error = refusal(application.control, session.name, motion_pb2.ControlInput(goal=goal))
    assert error.field.startswith("control.goal.pose")


def test_creation_checks_its_numbers(application):
    nan = float("nan")
    assert refusal(lambda: create(application, floor_height=nan)).field == "floor_height"
    place = motion_pb2.Placement(x=1e9)
    assert refusal(lambda: create(application, start_placement=place)).field == "start_placement.x"
    assert refusal(lambda: create(application, request_id="x" * 65)).field == "request_id"
    assert refusal(lambda: create(application, skeleton_id="sha256:other")).field == "skeleton_id"
    assert len(application.sessions) == 0


def test_start_from_a_pose_takes_its_place(application):
    walker = Walker()
    rotations = walker.skeleton.rest_rotations.astype("<f4").tobytes()
    pose = skeleton_pb2.Pose(root_position=np.array([2, 0.9, -1], "<f4").tobytes(), rotations=rotations)
    session = create(application, start_pose=pose)
    assert session.state.position == (2.0, -1.0)


def test_a_goal_is_reached_once_when_near_and_still():
    watch = GoalWatch(tolerance=0.05)
    approach = [1.0, 0.5, 0.04, 0.02] + [0.01] * 30
    assert [i for i, distance in enumerate(approach) if watch.reached(distance)] == [14]
    watch.restart()
    assert not any(watch.reached(0.2) for _ in range(30))
    assert not any(watch.reached(None) for _ in range(30))
