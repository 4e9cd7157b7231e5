"""Whoever is steered at furniture slides along it or stops before it; and a session remembers what is there."""

import math
from functools import partial

import numpy as np
import pytest
from furnished import box
from prometheus_client import CollectorRegistry
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animator import Animator
from roam_motion.app import SHIPPED_WEIGHTS
from roam_motion.control.intent import Goal, Idle, Steer
from roam_motion.control.keeping_out import kept_out, left_behind
from roam_motion.session.application import MotionApplication
from roam_motion.session.records import ControlChange, ControlRequest, SessionRequest
from roam_motion.settings import MotionSettings
from standing import seated_pose
from walker import Place, Walker

FIGURE = humanoid_figure()
SQUARE = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
ELL = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (0.3, 0.5), (0.3, -0.3), (-0.5, -0.3))


def kept(place, velocity, *outlines):
    return kept_out(FIGURE, outlines or (SQUARE,), place, velocity)


def test_away_from_furniture_nothing_changes():
    assert kept((0.0, 3.0), (0.2, -1.2)) == (0.2, -1.2)
    assert kept((0.0, 1.0), (0.2, 1.2)) == (0.2, 1.2)
    assert kept_out(FIGURE, (), (0.0, 0.0), (1.0, 0.0)) == (1.0, 0.0)


def test_head_on_it_stops_before():
    assert kept((0.0, 0.79), (0.0, -1.0)) == pytest.approx((0.0, 0.0), abs=1e-9)
    x, z = kept((0.0, 1.0), (0.0, -1.0))
    assert x == pytest.approx(0.0, abs=1e-9)
    assert -0.5 < z < 0.0


def test_at_a_slant_it_slides_along():
    assert kept((0.0, 0.79), (0.7, -0.7)) == pytest.approx((0.7, 0.0), abs=1e-9)
    assert kept((-0.79, 0.2), (0.7, 0.6)) == pytest.approx((0.0, 0.6), abs=1e-9)


def test_in_a_corner_it_stops():
    walls = ((-1.0, 0.5), (1.0, 0.5), (1.0, 0.7), (-1.0, 0.7)), ((0.5, -1.0), (0.7, -1.0), (0.7, 1.0), (0.5, 1.0))
    assert kept((0.25, 0.25), (0.6, 0.8), *walls) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert kept((0.25, 0.25), (-0.6, 0.8), *walls) == pytest.approx((-0.6, 0.0), abs=1e-9)


@pytest.mark.parametrize("outline", [SQUARE, ELL, SQUARE[::-1], ELL[::-1]])
def test_who_stands_inside_can_leave_and_comes_no_deeper(outline):
    assert kept((0.45, 0.1), (1.0, 0.0), outline) == (1.0, 0.0)
    assert kept((0.45, 0.1), (-1.0, 0.0), outline)[0] == pytest.approx(0.0, abs=1e-9)


def test_what_a_goal_leaves_behind():
    goal = Goal(seated_pose(), obstacles=(SQUARE,))
    assert left_behind(FIGURE, goal) == (SQUARE,)
    (room,) = left_behind(FIGURE, Goal(seated_pose()))
    assert len(room) == 4
    volume = box([-0.25, 0.0, 0.5], [0.25, 0.45, 1.0], yaw=0.0)
    (outline,) = left_behind(FIGURE, Goal(seated_pose(), volume=volume))
    assert np.array(outline).min(0) == pytest.approx([-0.25, 0.5], abs=0.05)
    assert np.array(outline).max(0) == pytest.approx([0.25, 1.0], abs=0.05)
    assert left_behind(FIGURE, Steer(np.float32([1, 0]), around=(SQUARE,))) == (SQUARE,)


async def test_a_session_remembers_it_through_all_that_follows():
    application = MotionApplication(
        Walker(),
        Walker.skeleton,
        MotionSettings(),
        CollectorRegistry(),
        restore=Place.joined,
        left_behind=partial(left_behind, FIGURE),
    )
    await application.ownership.renew()
    session = await application.create_session(SessionRequest())
    steer = ControlRequest(0, ControlChange(Steer(np.float32([1.0, 0.0]))))
    await application.control(session.name, steer)
    assert session.newest_intent.around == ()
    for change in (ControlChange(Goal(seated_pose(), obstacles=(SQUARE,))), ControlChange(Idle()), steer.change):
        await application.control(session.name, ControlRequest(0, change))
        await application.ticker.step([session])
    assert session.intent.around == (SQUARE,)
    assert session.snapshot("").change.intent.around == (SQUARE,)


@pytest.mark.skipif(not SHIPPED_WEIGHTS.exists(), reason="weights/motion.safetensors is not there: train or fetch it")
def test_nobody_walks_through_a_chair():
    animator = Animator.load(SHIPPED_WEIGHTS)
    straight, slanted = (
        Steer(np.float32(velocity), around=around)
        for velocity, around in (((0.0, -1.2), (SQUARE,)), ((0.7, -1.0), (SQUARE,)))
    )
    states = [animator.start((0.0, 2.0), math.pi, 0), animator.start((-0.3, 1.8), math.pi, 1)]
    nearest = np.full(2, np.inf)
    for _ in range(110):
        pairs = animator.step(states, [straight, slanted])
        states = [state for state, _ in pairs]
        places = np.array([state.place for state in states])
        outside = np.maximum(np.abs(places) - 0.5, 0.0)
        nearest = np.minimum(nearest, np.linalg.norm(outside, axis=-1))
    assert nearest.min() > 0.15
    assert places[0][1] < 1.0  # came up to it
    assert places[1][1] < -0.5  # slid past it
