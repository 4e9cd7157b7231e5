"""Frames are the same to the bit alone, in any company and after a resumption, whatever a character is doing."""

from dataclasses import replace

import numpy as np
import pytest
from furnished import bed, box
from roam_motion.animator import CharacterState, Goal, Idle, Steer
from roam_motion.control.actions import seat_of, transition
from roam_motion.control.controller import INTERACT, RISE
from roam_motion.graphs import Graphs
from standing import random_animator, seated_pose

pytestmark = pytest.mark.equal_bits

FRAMES = 4
CHAIR = Goal(seated_pose(), volume=box([-0.25, 0.0, -0.25], [0.25, 0.45, 0.25]))
THERE = np.array([2.0, 1.4, -1.0], np.float32)


@pytest.fixture(scope="module")
def animator():
    return random_animator()


def pair(x, z):
    return np.array([x, z], np.float32)


def interacting(animator, goal, place, **memory):
    """A character that takes, holds or leaves the pose of a goal."""
    state = animator.start(place, 0.4, 3)
    seat = seat_of(animator.figure, goal, place)
    planned = transition(animator.figure, seat)
    if planned is not None and "along" in memory:
        memory["along"] = round(memory["along"] * planned.last)
    return CharacterState(state.row, state.control._replace(seat=seat, **memory))


def kinds(animator):
    """By name: a character and what it is asked for."""
    standing = {
        "stands": Idle(),
        "looks": Idle(look_at=THERE),
        "walks": Steer(pair(0.5, 0.9)),
        "faces elsewhere": Steer(pair(0.5, 0.9), pair(-0.6, 0.8)),
        "turns on the spot": Steer(pair(0.0, 0.0), pair(0.0, -1.0)),
        "walks back, looking": Steer(pair(0.0, -0.7), pair(0.0, 1.0), look_at=THERE),
        "faster than can be": Steer(pair(9.0, 3.0), pair(3.0, -9.0)),
        "is steered at furniture": Steer(pair(0.1, -1.0), around=(((-1, 0), (1, 0), (1, 0.5), (-1, 0.5)),)),
        "goes to a chair": CHAIR,
        "goes to a chair without volume": replace(CHAIR, volume=None, obstacles=(((1, 1), (1, 2), (2, 2)),)),
        "goes to a bed": bed(),
    }
    found = {
        name: (animator.start((0.2 * k, 1.2), 0.5 * k, k), told) for k, (name, told) in enumerate(standing.items())
    }
    at = (0.05, 0.3)
    found |= {
        "sits down": (interacting(animator, CHAIR, at, mode=INTERACT, since=4), CHAIR),
        "is late in sitting down": (interacting(animator, CHAIR, at, mode=INTERACT, since=110), CHAIR),
        "looks as it sits": (
            interacting(animator, CHAIR, at, mode=INTERACT, since=40),
            replace(CHAIR, look_at=THERE),
        ),
        "gets up": (interacting(animator, CHAIR, at, mode=RISE, since=9), Steer(pair(1.0, 0.0))),
        "lies down": (interacting(animator, bed(), (0.8, 0.1), mode=INTERACT, along=0.4, pace=1.0), bed()),
        "lies": (interacting(animator, bed(), (0.1, 0.1), mode=INTERACT, along=1.0, since=50), bed()),
        "gets up from bed": (interacting(animator, bed(), (0.1, 0.1), mode=RISE, along=0.5, pace=-1.0), Idle()),
    }
    return found


def bits(pair):
    state, frame = pair
    return state.to_bytes() + frame.rotations.tobytes() + frame.snorm16.tobytes() + frame.positions.tobytes()


def alone(animator, state, intent, frames=FRAMES):
    """The bits of its frames, and the last state."""
    shown = []
    for _ in range(frames):
        (pair,) = animator.step([state], [intent])
        state = pair[0]
        shown.append(bits(pair))
    return shown, state


def together(animator, states, intents, frames=FRAMES):
    """Of each of them the bits of its frames."""
    shown = [[] for _ in states]
    for _ in range(frames):
        pairs = animator.step(states, intents)
        states = [state for state, _ in pairs]
        for of_one, pair in zip(shown, pairs, strict=True):
            of_one.append(bits(pair))
    return shown


def test_alone_in_company_and_at_any_place_in_it(animator):
    cast = kinds(animator)
    names, (states, intents) = list(cast), zip(*cast.values(), strict=True)
    single = {name: alone(animator, *character)[0] for name, character in cast.items()}
    for turn, size in enumerate((2, len(cast), 33, 70)):
        order = [(turn + 5 * k) % len(cast) for k in range(size)]
        for place, shown in enumerate(together(animator, [states[k] for k in order], [intents[k] for k in order])):
            name = names[order[place]]
            assert shown == single[name], f"{name}, {place} of {size}"


def test_after_a_resumption_in_other_company(animator):
    for name, (state, intent) in kinds(animator).items():
        unbroken, _ = alone(animator, state, intent, 2 * FRAMES)
        _, half = alone(animator, state, intent)
        again = CharacterState.from_bytes(half.to_bytes())
        others = [animator.start((k, k), 0.1 * k, k) for k in range(4)]
        shown = together(animator, [*others[:3], again, others[3]], [Idle()] * 3 + [intent, Steer(pair(0.1, 1.0))])
        assert shown[3] == unbroken[FRAMES:], name


def test_company_in_which_bits_differ_is_not_kept(animator, monkeypatch):
    """As on a processor whose products of matrices round otherwise for other numbers of them."""
    plain = Graphs.step

    def rounding(self, rows, *others):
        shown = plain(self, rows, *others)
        shown.rows[:] *= 1 + 1e-6 * (len(rows) > 1)
        return shown

    monkeypatch.setattr(Graphs, "step", rounding)
    monkeypatch.setattr(animator, "_in_company", True)  # as it is afterwards
    animator.warmed()
    states = [animator.start((k, 0), 0.3 * k, k) for k in range(5)]
    intents = [Steer(pair(0.3, 1.0))] * 5
    single = [alone(animator, state, intent)[0] for state, intent in zip(states, intents, strict=True)]
    assert together(animator, states, intents) == single
