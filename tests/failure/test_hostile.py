"""Callers that send what they should not, against real servers: it costs them, and nobody else."""

import base64
import threading
import time

import httpx
import numpy as np
import psutil
import pytest
from replicas import addresses, assert_same, ended_with_the_block, start_motion, unbroken, walking
from roam_client import Client, Frame, Placement, RoamError
from roam_client.sessions.controls import steer
from roam_motion.app import SHIPPED_WEIGHTS

PLACE = (0.5, -1.0, 0.75)  # numbers that float32 holds
SECONDS = 6.0  # of attack
READERS = 4


class Server:
    """One server with its memory store, and its processes."""

    def __init__(self, process):
        self.process = psutil.Process(process.pid)
        self.http, self.grpc = addresses(process)

    @property
    def memory(self):
        """Resident, of the server and what it started [MB]."""
        processes = [self.process, *self.process.children(recursive=True)]
        return sum(process.memory_info().rss for process in processes) / 1e6


@pytest.fixture(scope="module")
def server():
    """One for all tests."""
    if not SHIPPED_WEIGHTS.exists():
        pytest.skip("weights/motion.safetensors is not there")
    process = start_motion("memory")
    with ended_with_the_block(process):
        yield Server(process)


class Reader(threading.Thread):
    """A well-behaved caller: steers, reads every frame, and keeps them."""

    def __init__(self, address, number):
        super().__init__()
        self.address, self.number, self.frames, self.failure = address, number, [], None
        self.enough = threading.Event()

    def run(self):
        try:
            with Client(motion=self.address) as client, client.create_session(Placement(*PLACE)) as session:
                session.steer(0.1 * self.number, 1.0)
                with session.stream(pacing="burst") as stream:
                    for item in stream:
                        if isinstance(item, Frame):
                            self.frames.append(item)
                        if self.enough.is_set():
                            return
        except Exception as error:
            self.failure = error


def attack(address, stop, told):
    """Sends controls on a stream as fast as it takes them, and opens another session when it is thrown out."""
    number = 0
    while not stop.is_set():
        try:
            with Client(motion=address) as client, client.create_session() as session, session.stream() as stream:
                items = iter(stream)
                while not stop.is_set():
                    number += 20
                    for part in range(20):
                        stream.send(steer(part / 10, 1.0))
                    next(items)
        except RoamError as error:
            told.append(getattr(error, "reason", type(error).__name__))
    told.append(number)


def test_floods_of_controls_cost_nobody_else_a_frame_and_memory_stays_flat(server):
    readers = [Reader(server.grpc, number) for number in range(1, READERS + 1)]
    for reader in readers:
        reader.start()
    while any(len(reader.frames) < 30 and reader.failure is None for reader in readers):
        time.sleep(0.05)
    before, stop, told = server.memory, threading.Event(), []
    attackers = [threading.Thread(target=attack, args=(server.grpc, stop, told)) for _ in range(4)]
    for thread in attackers:
        thread.start()
    time.sleep(SECONDS)
    stop.set()
    for thread in attackers:
        thread.join()
    after = server.memory
    for reader in readers:
        reader.enough.set()
    for reader in readers:
        reader.join(timeout=30)
        assert reader.failure is None
        sequences = [frame.sequence for frame in reader.frames]
        assert sequences == list(range(1, len(sequences) + 1))
    sent = sum(item for item in told if isinstance(item, int))
    assert sent > 500
    assert "RATE_LIMITED" in told
    assert after - before < 60, f"{before:.0f} MB before, {after:.0f} MB after {sent} controls"


@pytest.mark.parametrize(
    "goal",
    [
        {"action": "lie", "pose": {"root_position": [9000.0, 0.5, 0.0]}},
        {"action": "sit", "pose": {"root_position": [0.0, 2.4, 0.0]}},
        {"action": "lie", "pose": {"root_position": [0.0, 0.9, 0.0]}},
    ],
    ids=["10 km off", "in the air", "standing and lying"],
)
def test_a_goal_that_cannot_be_is_refused_and_others_go_on(server, goal):
    """Before, each of these ended the step process, then the ticker, then every replica in turn."""
    rotations = [[0.0, 0.0, 0.0, 1.0]] * 22
    values = np.full((12, 12, 12), 100, np.int8)
    values[4:8, :6, 4:8] = -20
    volume = {"origin": [-0.3, -0.05, -0.3], "pitch": 0.06, "size": [12, 12, 12]}
    volume["values"] = base64.b64encode(values.tobytes()).decode()
    body = {"goal": goal | {"volume": volume, "pose": goal["pose"] | {"rotations": rotations}}}
    with Client(motion=server.grpc) as client, client.create_session(Placement(*PLACE)) as session:
        started = session.steer(0.3, 1.0)
        answer = httpx.post(f"{server.http}/v1/{session.name}/control", json=body, timeout=30)
        assert (answer.status_code, answer.json()["reason"]) == (400, "GOAL_INVALID")
        assert answer.json()["detail"]
        with session.stream(pacing="burst") as stream:
            frames = []
            for item in stream:
                if isinstance(item, Frame):
                    frames.append(item)
                if len(frames) == 30:
                    break
    assert_same(frames, unbroken(PLACE, {started: walking(0.3, 1.0)}, 30))
