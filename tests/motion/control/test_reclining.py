"""Lying down by way of the furniture's edge: a box of a bed, and a lying pose in its middle."""

import numpy as np
import pytest
import torch
from furnished import TOP, bed
from roam_motion.animation.collision import furniture_of
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animation.state import characters_width
from roam_motion.animator import Animator, CharacterState
from roam_motion.app import SHIPPED_WEIGHTS
from roam_motion.control.actions import seat_of, transition
from roam_motion.control.controller import INTERACT, RISE, Body, Control
from roam_motion.control.intent import Idle
from roam_motion.control.planner import Plan
from standing import controlled, played

FIGURE = humanoid_figure()
NAMES = FIGURE.skeleton


def way(goal=None, place=(2.0, 0.0), manner=()):
    goal = goal or bed()
    return transition(FIGURE, seat_of(FIGURE, goal, place), manner)


PERSONS = [(-2.0,), (0.0,), (2.0,)]  # who lie down in three ways


def gaps(positions):
    """Distances [T, 6] of shins, ankles and toes from the bed [m]."""
    joints = torch.tensor(positions)
    shins = (joints[:, FIGURE.legs[:, 1]] + joints[:, FIGURE.legs[:, 2]]) / 2
    points = torch.cat([shins, joints[:, FIGURE.legs[:, 2]], joints[:, FIGURE.legs[:, 3]]], 1)
    furniture = furniture_of([bed().volume], [np.zeros(0, np.float32)], [True])
    return furniture.distance(points.flatten(0, 1)[None])[0].reshape(len(points), -1).numpy()


@pytest.mark.parametrize("place", [(2.0, 0.0), (-2.0, 0.5)])
def test_the_way_begins_seated_on_the_edge_and_ends_in_the_goal(place):
    reclining = way(place=place)
    sign = np.sign(place[0])
    edge, goal = reclining.at(0), reclining.at(reclining.last)
    assert (edge.action, goal.action) == ("sit", "lie")
    np.testing.assert_array_equal(reclining.positions[reclining.last], goal.positions)
    assert reclining.at(reclining.end) is edge is reclining.entry
    np.testing.assert_allclose(edge.root[2:], [sign, 0.0], atol=0.02)  # faces the open side
    assert 0.1 < sign * edge.positions[0, 0] < 0.5  # hips over the bed
    assert TOP + 0.03 < edge.positions[0, 1] < TOP + 0.16
    ankles = edge.positions[FIGURE.legs[:, 2]]
    assert (sign * ankles[:, 0] > 0.55).all()  # in front of it
    assert ((ankles[:, 1] > 0.05) & (ankles[:, 1] < 0.12)).all()  # on the floor


@pytest.mark.parametrize("manner", PERSONS)
def test_legs_come_over_the_edge_and_nothing_moves_too_fast(manner):
    reclining = way(manner=manner)
    steps = np.linalg.norm(np.diff(reclining.positions, axis=0), axis=-1)
    assert steps.max() < 0.045
    assert steps[:2].max() < 0.01  # from rest
    assert steps[reclining.last - 2 : reclining.last + 2].max() < 0.012  # to rest, and from it
    assert steps[-2:].max() < 0.01
    assert gaps(reclining.positions).min() > 0.03
    turned = reclining.orientations
    assert 90 < reclining.last < 160
    assert 90 < reclining.end - reclining.last < 160
    np.testing.assert_allclose(turned @ turned.swapaxes(-1, -2), np.broadcast_to(np.eye(3), turned.shape), atol=1e-4)


def test_feet_come_up_one_after_the_other_and_a_hand_is_put_down():
    for manner in PERSONS:
        reclining = way(manner=manner)
        down = reclining.positions[: reclining.last + 1]
        feet = down[:, FIGURE.legs[:, 2], 1]
        assert (feet.min(1) - down[:, 0, 1]).max() < 0.02  # never both over the hips
        assert (feet.max(1) - feet.min(1)).max() > 0.15
        hands = down[:, NAMES.indices(["leftHand", "rightHand"]), 1].min(1)
        trunk = down[:, NAMES.index("neck")] - down[:, 0]
        leans = np.degrees(np.arccos(trunk[:, 1] / np.linalg.norm(trunk, axis=-1)))
        assert hands[(leans > 30) & (leans < 70)].min() < TOP + 0.17


def test_persons_lie_down_differently_and_nobody_gets_up_the_same_way_backwards():
    ways = [way(manner=manner) for manner in PERSONS]

    def even(track):
        return track[np.linspace(0, len(track) - 1, 40).round().astype(int)]

    def apart(one, other):
        return float(np.linalg.norm(even(one) - even(other), axis=-1).mean())

    downs = [w.positions[: w.last + 1] for w in ways]
    assert min(apart(downs[i], downs[j]) for i, j in ((0, 1), (0, 2), (1, 2))) > 0.05
    assert min(apart(w.positions[: w.last + 1][::-1], w.positions[w.last :]) for w in ways) > 0.05
    assert way(manner=(0.1,)) is way(manner=(0.0,))  # one person, one way


def test_one_lies_down_from_the_side_without_a_board():
    for wall, sign in (("left", -1.0), ("right", 1.0)):
        for place in ((2.0, 0.0), (-2.0, 0.0)):
            assert sign * seat_of(FIGURE, bed(wall), place).stand[0] > 0.5
    assert seat_of(FIGURE, bed(), (2.0, 0.0)).stand[0] > 0.5 > seat_of(FIGURE, bed(), (-2.0, 0.0)).stand[0]


def obedient(state, intent, frames):
    """A body that is wherever it is told to be: memory and command of every frame."""
    shown = []
    for _ in range(frames):
        body = Body(*map(float, state.seat.stand[:2]), 0.0, 0.93)
        if shown and shown[-1][1].active:
            hips = shown[-1][1].pose[0]
            body = Body(float(hips[0]), float(hips[2]), 0.0, float(hips[1]))
        state, command = controlled(state, intent, body)
        shown.append((state, command))
        if state.seat is None or state.mode not in (INTERACT, RISE):
            break
    return state, shown


def test_control_sits_lies_and_gets_up():
    goal = bed()
    seat = seat_of(FIGURE, goal, (2.0, 0.0))
    state, down = obedient(Control(Plan(0, 0), INTERACT, seat), goal, 200)
    assert state.along == way().last
    assert down[0][1].style == "sit"
    assert down[-1][1].style == "lie"
    np.testing.assert_array_equal(down[-1][1].pose, seat.positions)
    assert down[-1][1].urgency == 0.0
    state, up = obedient(state, Idle(), 250)
    lowest = [command.pose[0] for _, command in up if command.active]
    np.testing.assert_allclose(lowest[-1], way().entry.positions[0], atol=1e-6)
    assert len(up) < 200
    assert state.mode not in (INTERACT, RISE)


def test_whoever_is_called_while_lying_down_turns_round_without_a_jump():
    goal = bed()
    state, down = obedient(Control(Plan(0, 0), INTERACT, seat_of(FIGURE, goal, (2.0, 0.0))), goal, 75)
    assert 0 < state.along < way().last
    again = CharacterState.from_bytes(
        CharacterState(np.zeros(characters_width(22), np.float32), state).to_bytes()
    ).control
    assert (again.along, again.pace) == (state.along, state.pace)
    _, up = obedient(state, Idle(), 30)
    shown = np.stack([command.pose for _, command in [*down[-30:], *up] if command.active])
    assert np.linalg.norm(np.diff(shown, axis=0), axis=-1).max() < 0.08
    assert up[-1][0].along < state.along


@pytest.mark.skipif(not SHIPPED_WEIGHTS.exists(), reason="weights/motion.safetensors is not there: train or fetch it")
def test_shipped_weights_lie_down_and_get_up_at_once():
    animator = Animator.load(SHIPPED_WEIGHTS)
    states, shown = played(animator, [animator.start((1.9, 0.2), -1.5, 0)], [bed()], frames=300)
    far = [row[0].goal_distance for row in shown if row[0].goal_distance is not None]
    assert far[-1] < 0.01
    assert far[0] > 0.3  # told of the lying pose, not of the edge
    states, after = played(animator, states, [Idle()], frames=210)
    motion = np.stack([row[0].positions for row in [*shown, *after]])
    assert np.linalg.norm(np.diff(motion, axis=0), axis=-1).max() < 0.15
    assert after[-1][0].root_position[1] > 0.86
    assert all(row[0].goal_distance is None for row in after)
    assert gaps(motion.astype(np.float32)).min() > 0.0
