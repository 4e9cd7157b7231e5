"""Real servers as processes, a real Redis between them, and the motion that they should have streamed."""

import os
import shutil
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import psutil
from roam_motion.animator import Animator, Idle, Steer
from roam_motion.app import SHIPPED_WEIGHTS

REDIS = shutil.which("redis-server")
ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1"}


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class Redis:
    """A Redis that writes everything down, so that it can be restarted."""

    def __init__(self, folder):
        self.port = free_port()
        self.url = f"redis://127.0.0.1:{self.port}"
        self._folder = folder
        self.start()

    def start(self):
        place = ["--port", str(self.port), "--bind", "127.0.0.1", "--dir", str(self._folder)]
        self.process = subprocess.Popen([REDIS, *place, "--appendonly", "yes", "--save", ""], stdout=subprocess.DEVNULL)

    def stop(self):
        self.process.kill()
        self.process.wait()

    def restart(self):
        self.stop()
        self.start()


def start_motion(store):
    """`python -m roam_motion.app` on free ports; call `address` to wait until it is ready."""
    arguments = ["--http-port", "0", "--grpc-port", "0", "--log-level", "error", "--session-store", store]
    return subprocess.Popen(
        [sys.executable, "-m", "roam_motion.app", *arguments], env=ENVIRONMENT, stdout=subprocess.PIPE, text=True
    )


def address(process):
    """Where a starting server listens for gRPC."""
    return addresses(process)[1]


def addresses(process):
    """Where a starting server listens for HTTP, and for gRPC."""
    _, http, grpc = process.stdout.readline().split()
    return http.removeprefix("http="), grpc.removeprefix("grpc=")


@contextmanager
def ended_with_the_block(*processes):
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()
            if process.stdout:
                process.stdout.close()


@dataclass
class Replica:
    """One motion server."""

    process: subprocess.Popen
    address: str

    def kill(self):
        self.process.send_signal(signal.SIGKILL)

    def terminate(self):
        self.process.terminate()

    def stepping(self):
        """The processes that step for it: one."""
        children = psutil.Process(self.process.pid).children()
        return [child.pid for child in children if any("spawn_main" in word for word in child.cmdline())]

    def kill_stepping(self):
        """Kills that one; its process id."""
        (pid,) = self.stepping()
        os.kill(pid, signal.SIGKILL)
        return pid


def anyone(*replicas):
    """An address that means the first of these replicas that answers."""
    return "ipv4:" + ",".join(replica.address for replica in replicas)


def unbroken(place, controls, count):
    """The frames 1 … count of a motion that nothing interrupts; `controls` maps first frames to intents."""
    animator = Animator.load(SHIPPED_WEIGHTS)
    state, intent = animator.start(place[:2], place[2], 0), Idle()
    frames = []
    for sequence in range(1, count + 1):
        intent = controls.get(sequence, intent)
        ((state, frame),) = animator.step([state], [intent])
        frames.append(frame)
    return frames


def walking(velocity_x, velocity_z):
    return Steer(np.array([velocity_x, velocity_z], np.float32))


def assert_same(received, frames):
    """Every received frame is the unbroken motion's frame of its sequence, bit for bit."""
    for frame in received:
        expected = frames[frame.sequence - 1]
        assert frame.root_position.tobytes() == expected.root_position.tobytes(), frame.sequence
        assert frame.rotations.tobytes() == expected.rotations.tobytes(), frame.sequence
