import math

import numpy as np
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animator import Goal, Idle, Steer
from roam_motion.control.actions import seat_of
from roam_motion.control.controller import FREE, INTERACT, RISE, Body, Control
from roam_motion.control.planner import Plan
from standing import controlled, seated_pose

FIGURE = humanoid_figure()


def follow_plan(intent, body, frames=400):
    """A body that is wherever the plan is."""
    state = Control(Plan(body.x, body.z, yaw=body.yaw))
    for _ in range(frames):
        state, command = controlled(state, intent, body)
        if state.mode != FREE:
            break
        body = Body(state.plan.x, state.plan.z, state.plan.yaw, body.height)
    return state, command, body


def test_an_approach_ends_in_front_of_the_seat_facing_away_from_it():
    state, command, body = follow_plan(Goal(seated_pose()), Body(1.0, 3.0, math.pi, 0.95))
    assert state.mode == INTERACT
    feet = seated_pose().positions()[FIGURE.contacts.numpy()[[0, 2]]][:, [0, 2]].mean(0)
    assert math.hypot(body.x - feet[0], body.z - feet[1] - 0.05) < 0.15
    assert abs(body.yaw) < math.radians(30)
    assert command.active
    assert command.style == "sit"


def test_another_command_makes_a_seated_character_rise_first():
    goal = Goal(seated_pose())
    seated = Body(0.0, 0.0, 0.0, 0.56)
    state = Control(Plan(0, 0), INTERACT, seat_of(FIGURE, goal, (0.0, 0.0)))
    held, command = controlled(state, goal, seated)
    assert (held.mode, command.active) == (INTERACT, True)
    for intent in (Idle(), Steer(np.array([0.0, 1.0])), Goal(seated_pose(ahead=2.0))):
        rising, command = controlled(state, intent, seated)
        assert (rising.mode, command.active) == (RISE, False)
        np.testing.assert_allclose(command.places[0], state.seat.stand[:2])
    up, _ = controlled(rising, Idle(), Body(*map(float, state.seat.stand[:2]), 0.0, 0.93))
    assert up.mode == FREE


def test_lying_is_approached_from_the_asked_side():
    pose = seated_pose()
    near = seat_of(FIGURE, Goal(pose, "lie"), (-3.0, 0.0))
    asked = seat_of(FIGURE, Goal(pose, "lie", np.array([1.0, 0.0])), (-3.0, 0.0))
    assert near.stand[0] < 0 < asked.stand[0]
    np.testing.assert_allclose(asked.stand[2:], [1.0, 0.0], atol=1e-5)
    sofa = ((-0.9, -1.0), (0.3, -1.0), (0.3, 1.0), (-0.9, 1.0))  # ends sooner on the pose's left
    sooner = seat_of(FIGURE, Goal(pose, "lie", obstacles=(sofa,)), (-3.0, 0.0))
    assert sooner.stand[0] > 0.4


def test_steering_sets_the_path_and_the_action():
    state = Control(Plan(0, 0))
    for _ in range(20):
        state, command = controlled(
            state, Steer(np.array([0.8, 0.0])), Body(state.plan.x, state.plan.z, state.plan.yaw, 0.95)
        )
    assert command.style == "walk"
    assert command.places[-1, 0] - command.places[0, 0] > 1.2
    _, command = controlled(Control(Plan(0, 0)), Idle(), Body(0, 0, 0, 0.95))
    assert command.style == "idle"
