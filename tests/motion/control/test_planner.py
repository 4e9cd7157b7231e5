import math

import numpy as np
import pytest
from roam_motion.control.planner import Plan, Steering, Target, advance_plan, follow, plan_keys


def walk(plan, aim, seconds):
    track = []
    for _ in range(int(seconds * 30)):
        plan = advance_plan(plan, aim, 1 / 30)
        track.append((plan.x, plan.z, plan.yaw))
    return plan, np.array(track)


def test_a_plan_arrives_and_turns():
    plan, _ = walk(Plan(0.5, 3.0, yaw=math.pi), Target(0.0, 0.4, 0.0, ((0.5, 3.0), (0.0, 0.4))), 9)
    assert math.hypot(plan.x, plan.z - 0.4) < 0.06
    assert abs(plan.yaw) < 0.1


def test_a_plan_keeps_to_its_way():
    corner = ((0.0, -3.0), (1.5, -3.0), (1.5, 0.4), (0.0, 0.4))
    plan, track = walk(Plan(0.0, -3.0, yaw=math.pi / 2), Target(0.0, 0.4, math.pi, corner), 14)
    assert math.hypot(plan.x, plan.z - 0.4) < 0.06
    assert track[:, 0].max() < 1.8
    off = np.minimum(np.minimum(np.abs(track[:, 1] + 3.0), np.abs(track[:, 0] - 1.5)), np.abs(track[:, 1] - 0.4))
    assert off.max() < 0.2


def test_nobody_plans_to_walk_faster_than_people_do():
    _, track = walk(Plan(0.0, 5.0), Target(0.0, 0.0, 0.0, ((0.0, 5.0), (0.0, 0.0))), 8)
    speed = np.hypot(*np.diff(track[:, :2], axis=0).T) * 30
    assert 0.7 < speed.max() < 1.3
    assert np.abs(np.diff(np.unwrap(track[:, 2]))).max() * 30 < 2.5


def test_steering_reaches_the_wanted_velocity_and_facing():
    plan, _ = walk(Plan(0, 0), Steering(0.0, -0.5, 0.0), 3)
    assert plan.vz == pytest.approx(-0.5, abs=0.01)
    assert plan.yaw == pytest.approx(0.0, abs=0.05)
    (places,), (directions,) = plan_keys([plan], [Steering(0.0, -0.5, 0.0)])
    assert places.shape == directions.shape == (13, 2)
    assert places[-1, 1] - places[0, 1] == pytest.approx(-1.0, abs=0.05)


def test_the_plan_stays_near_the_character():
    plan = Plan(0, 0)
    for _ in range(90):
        plan = follow(plan, Steering(1.0, 0.0, None), 0.0, 0.0, 0.0, 1 / 30)
    assert math.hypot(plan.x, plan.z) < 0.4


def test_keys_are_the_plan_that_is_followed():
    way = ((0.5, 3.0), (0.5, 3.0), (1.2, 1.0), (0.0, 0.4))  # begins with a leg of no length
    aims = (
        Target(0.0, 0.4, 0.3, way),
        Steering(0.4, -0.6, None),
        Steering(0.0, 0.0, None),
        Steering(0.2, 0.1, -3.0),
        Steering(0.0, 0.0, 1.0),
    )
    plans = [Plan(0.5, 3.0, 0.1, -0.2, 3.0, 0.4 * sign) for sign in (1, -1, 3, -9, 9)]
    together = plan_keys(plans, aims)
    for plan, aim, *keys in zip(plans, aims, *together, strict=True):
        for place, direction in zip(*keys, strict=True):
            np.testing.assert_allclose(place, (plan.x, plan.z), atol=1e-6)
            np.testing.assert_allclose(direction, (math.sin(plan.yaw), math.cos(plan.yaw)), atol=1e-6)
            plan = advance_plan(advance_plan(plan, aim, 1 / 12), aim, 1 / 12)


def test_keys_are_the_same_to_the_bit_in_any_company():
    rng = np.random.default_rng(0)
    plans = [Plan(*numbers) for numbers in rng.normal(size=(70, 6))]
    aims = [Steering(*rng.normal(size=2), None if row % 3 else float(rng.normal())) for row in range(70)]
    together = plan_keys(plans, aims)
    for row in range(70):
        alone = plan_keys(plans[row : row + 1], aims[row : row + 1])
        assert all(np.array_equal(one[0], of_all[row]) for one, of_all in zip(alone, together, strict=True))
