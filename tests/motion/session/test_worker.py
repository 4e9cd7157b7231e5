"""Frames from a process of their own: the same bits, whatever happens to the process."""

import os
import pickle
import signal
from types import SimpleNamespace

import numpy as np
import pytest
from roam_motion.animator import CharacterState, Goal, Idle, Steer
from roam_motion.session.worker import CulpritError, WorkerProcess, _Worker, _WorkerLink, build_name, frames_of
from standing import random_animator, seated_pose


def load(weights):
    return random_animator().step


def load_nothing(weights):
    raise ValueError(f"no weights at {weights}")


def load_poisoned(weights):
    step = random_animator().step

    def poisoned(states, intents):
        if any(isinstance(intent, Steer) and intent.velocity[0] > 5 for intent in intents):
            raise ArithmeticError("poisoned")
        return step(states, intents)

    return poisoned


def load_deadly(weights):
    step = random_animator().step

    def deadly(states, intents):
        if any(isinstance(intent, Steer) and intent.velocity[0] > 5 for intent in intents):
            os._exit(7)
        return step(states, intents)

    return deadly


@pytest.fixture(scope="module")
def process():
    process = WorkerProcess("none", load=load)
    yield process
    process.close()


def cast():
    animator = random_animator()
    states = [animator.start((0.4 * i, 0.0), 0.3 * i, i) for i in range(4)]
    return states, [Idle(), Steer(np.float32([0.0, 1.0])), Goal(seated_pose(ahead=0.3)), Goal(seated_pose(), "lie")]


def played(frames, states, intents, rounds, count=1):
    shown = []
    for _ in range(rounds):
        results = frames(states, [[intent] * count for intent in intents])
        states = [of_one[-1][0] for of_one in results]
        shown += [frame for of_one in results for _, frame in of_one]
    return states, shown


def alike(one, other):
    states = all(a.to_bytes() == b.to_bytes() for a, b in zip(one[0], other[0], strict=True))
    frames = all(
        np.array_equal(a.rotations, b.rotations)
        and np.array_equal(a.snorm16, b.snorm16)
        and np.array_equal(a.root, b.root)
        and (a.action, a.goal_distance) == (b.action, b.goal_distance)
        for a, b in zip(one[1], other[1], strict=True)
    )
    return states and frames


def test_frames_are_those_of_the_animator(process):
    states, intents = cast()
    step = random_animator().step
    here = played(lambda s, i: frames_of(step, s, i), states, intents, 4, count=3)
    assert alike(played(process.frames, states, intents, 4, count=3), here)


def test_a_process_that_dies_goes_on_where_it_was():
    process = WorkerProcess("none", load=load)
    states, intents = cast()
    whole = played(process.frames, states, intents, 6)
    half, first = played(process.frames, states, intents, 3)
    died = process.pid
    os.kill(died, signal.SIGKILL)
    after, last = played(process.frames, half, intents, 3)
    assert process.pid != died
    assert alike((after, first + last), whole)
    process.close()


def test_a_state_of_before_can_be_stepped_again(process):
    states, intents = cast()
    once = played(process.frames, states, intents, 1)
    assert alike(played(process.frames, states, intents, 1), once)
    again = [CharacterState.from_bytes(state.to_bytes()) for state in once[0]]
    assert alike(played(process.frames, again, intents, 2), played(process.frames, once[0], intents, 2))


def test_one_bad_character_does_not_stop_the_others():
    process = WorkerProcess("none", load=load_poisoned)
    states, intents = cast()
    intents[1] = Steer(np.float32([9.0, 0.0]))
    results = process.frames(states, [[intent] * 2 for intent in intents])
    assert isinstance(results[1][0], ArithmeticError)
    assert [len(of_one) for of_one in results] == [2, 1, 2, 2]
    following = process.frames([results[0][-1][0]], [[Idle()]])
    assert isinstance(following[0][0][0], CharacterState)
    process.close()


def test_who_kills_the_process_every_time_is_found_and_the_others_go_on():
    """Two of five do: each gets an error, the other three the frames that they would have had anyway."""
    process = WorkerProcess("none", load=load_deadly)
    animator = random_animator()
    states, intents = cast()
    deadly = Steer(np.float32([6.0, 0.0]))
    mixed = [(states[0], intents[0]), (states[1], deadly), (states[1], intents[1]), (states[2], deadly)]
    mixed.append((states[2], intents[2]))
    try:
        results = process.frames([state for state, _ in mixed], [[intent] * 2 for _, intent in mixed])
        again = process.frames(states, [[intent] for intent in intents])
    finally:
        process.close()
    assert [isinstance(of_one[-1], CulpritError) for of_one in results] == [False, True, False, True, False]
    plain = frames_of(animator.step, states[:3], [[intent] * 2 for intent in intents[:3]])
    survived = [of_one for of_one in results if not isinstance(of_one[-1], Exception)]
    pairs = [(a, b) for one, other in zip(survived, plain, strict=True) for a, b in zip(one, other, strict=True)]
    assert all(a[0].to_bytes() == b[0].to_bytes() for a, b in pairs)
    assert len(again) == len(states)


def test_when_all_fail_each_is_told(process_that_fails):
    states, _ = cast()
    results = process_that_fails.frames(states, [[Steer(np.float32([6.0, 0.0]))]] * len(states))
    assert [str(of_one[-1]) for of_one in results] == ["poisoned"] * len(states)


@pytest.fixture
def process_that_fails():
    process = WorkerProcess("none", load=load_poisoned)
    yield process
    process.close()


def test_a_network_that_cannot_be_loaded_is_told():
    with pytest.raises(ValueError, match="no weights at nowhere"):
        WorkerProcess("nowhere", load=load_nothing)


def test_the_process_forgets_what_the_server_has_let_go():
    worker = _Worker(random_animator().step, SimpleNamespace(value=0))
    link = _WorkerLink(Loop(worker))
    states, intents = cast()
    states, _ = played(link.frames, states, intents, 5)
    link.frames(states[:1], [[intents[0]]])
    assert len(worker._states._things) == len(states) + 1
    assert len(worker._intents._things) == len(intents)
    assert len(link._seats._things) <= 2


class Loop:
    """A pipe to a worker in this process."""

    def __init__(self, worker):
        self.worker = worker

    def send_bytes(self, data):
        self.answer = pickle.dumps(self.worker.answer(pickle.loads(data)))

    def poll(self, seconds):
        return True

    def recv_bytes(self):
        return self.answer


def test_another_network_or_another_code_makes_another_build(tmp_path):
    (tmp_path / "step.py").write_text("a = b + c + d\n")
    first = build_name("weights", [tmp_path])
    assert build_name("weights", [tmp_path]) == first
    assert build_name("others", [tmp_path]) != first
    (tmp_path / "step.py").write_text("a = b + (c + d)\n")
    assert build_name("weights", [tmp_path]) != first
    assert build_name("weights") == build_name("weights")
