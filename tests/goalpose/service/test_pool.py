"""Synthesizers in processes of their own: answers, progress, cancellation, death."""

import os
import threading
import time

import numpy as np
import psutil
import pytest
from pool_worker import DIE, FAIL, REFUSE, WAIT, load, load_counter, load_nothing
from poser import Poser, box_file
from roam_goalpose.objects import load_shape
from roam_goalpose.service.pool import SynthesizerPool
from roam_goalpose.solvers.progress import Cancelled
from roam_goalpose.synthesis import GoalPoseRequest, RequestError, SynthesizerSettings


@pytest.fixture(scope="module")
def pool():
    made = SynthesizerPool(SynthesizerSettings(), processes=2, load=load)
    yield made
    made.close()


@pytest.fixture(scope="module")
def shape():
    return load_shape(box_file(), "glb")


def test_an_answer_of_a_process_is_that_of_a_thread(pool, shape):
    request = GoalPoseRequest(reference="chair_sit", seed=5)
    told = []
    there = pool.synthesize(shape, request, progress=told.append)
    here = Poser().synthesize(shape, request, progress=lambda progress: None)
    assert (there.name, there.energies, there.warnings) == (here.name, here.energies, here.warnings)
    np.testing.assert_array_equal(there.pose.rotations, here.pose.rotations)
    np.testing.assert_array_equal(there.pose.root_position, here.pose.root_position)
    assert (pool.field_name, list(pool.references)) == ("sha256:poser", ["chair_sit", "sofa_lie"])
    assert [progress.stage_name for progress in told] == ["preparing"]
    assert there.seconds != os.getpid()


def test_cancellation_frees_the_process_for_the_next_one(pool, shape):
    """Both processes wait until they are told to stop; both are there again afterwards."""
    leave = threading.Event()
    outcomes, told = [], []

    def ask():
        try:
            pool.synthesize(shape, GoalPoseRequest(seed=WAIT), progress=told.append, cancelled=leave.is_set)
        except Cancelled:
            outcomes.append("cancelled")

    threads = [threading.Thread(target=ask) for _ in range(2)]
    for thread in threads:
        thread.start()
    while len(told) < 2:
        time.sleep(0.005)
    leave.set()
    for thread in threads:
        thread.join(timeout=10)
    assert outcomes == ["cancelled"] * 2
    assert pool.synthesize(shape, GoalPoseRequest(seed=1)).name.endswith("1")


def test_errors_come_back_as_what_they_are(pool, shape):
    with pytest.raises(RequestError, match="not this one") as caught:
        pool.synthesize(shape, GoalPoseRequest(seed=REFUSE))
    assert caught.value.field == "solver"
    with pytest.raises(RuntimeError, match="deep inside"):
        pool.synthesize(shape, GoalPoseRequest(seed=FAIL))
    assert pool.synthesize(shape, GoalPoseRequest(seed=2)).name.endswith("2")


def test_a_process_that_dies_fails_its_request_and_no_other(pool, shape):
    with pytest.raises(RuntimeError, match="code 7"):
        pool.synthesize(shape, GoalPoseRequest(seed=DIE))
    for seed in (3, 4):
        assert pool.synthesize(shape, GoalPoseRequest(seed=seed)).name.endswith(str(seed))


def test_a_pool_that_cannot_load_says_why_and_leaves_nothing_running():
    before = {child.pid for child in psutil.Process().children()}
    with pytest.raises(RuntimeError, match="no weights here"):
        SynthesizerPool(SynthesizerSettings(), processes=2, load=load_nothing)
    assert {child.pid for child in psutil.Process().children()} <= before


def test_closing_ends_the_processes():
    before = {child.pid for child in psutil.Process().children()}
    pool = SynthesizerPool(SynthesizerSettings(), processes=1, load=load)
    started = [child for child in psutil.Process().children() if child.pid not in before]
    assert started
    pool.close()
    assert not [child for child in psutil.Process().children() if child.pid not in before]


def test_lanes_of_one_process_work_at_once_and_die_together(shape):
    """Two callers wait in one process at the same time; when it dies both fail, and it is there for the next one."""
    pool = SynthesizerPool(SynthesizerSettings(), processes=1, lanes=3, load=load)
    told, outcomes = [], []

    def ask():
        try:
            pool.synthesize(shape, GoalPoseRequest(seed=WAIT), progress=told.append, cancelled=lambda: False)
        except RuntimeError as error:
            outcomes.append(str(error))

    threads = [threading.Thread(target=ask) for _ in range(2)]
    for thread in threads:
        thread.start()
    while len(told) < 2:
        time.sleep(0.005)
    with pytest.raises(RuntimeError, match="code 7"):
        pool.synthesize(shape, GoalPoseRequest(seed=DIE))
    for thread in threads:
        thread.join(timeout=10)
    assert len(outcomes) == 2
    assert pool.synthesize(shape, GoalPoseRequest(seed=6)).name.endswith("6")
    pool.close()


def test_cancellation_frees_the_real_worker_within_one_iteration():
    """In every stage: counted in the process, from the iteration during which the caller leaves.

    Not every number is told: where a stage ends early the next goes on with a later one.
    """
    pool = SynthesizerPool(SynthesizerSettings(), processes=1, load=load_counter)
    chair = pool.references["chair_sit"].shape
    for iteration in (1, 3, 5, 9, 16):
        told = []
        with pytest.raises(RequestError) as caught:
            pool.synthesize(
                chair,
                GoalPoseRequest(reference="chair_sit", seed=iteration),
                progress=told.append,
                cancelled=lambda told=told, last=iteration: bool(told) and told[-1].iteration >= last,
            )
        assert caught.value.field == "iterations"
        assert int(str(caught.value)) <= 1
    assert pool.synthesize(chair, GoalPoseRequest(reference="chair_sit")).energies["total"] < 1
    pool.close()
