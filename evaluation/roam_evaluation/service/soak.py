"""`roam evaluate soak`: whether a motion server's memory levels off while characters come and go.

So many readers at once, each with a character of its own that walks, turns, and every third time sits down; after a
while the reader deletes it and makes the next one. Memory is sampled all along, and its slope fitted by least squares.

    python -m roam_evaluation.service.soak [--minutes 60] [--sessions 16] [--life 20] [--json FILE]
"""

import argparse
import asyncio
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import grpc
import numpy as np
import psutil
from roam.v1 import motion_pb2, motion_pb2_grpc

from roam_evaluation.service.load import chair_goal
from roam_evaluation.service.server_process import ServerProcess, motion_servers

_WARM = 2.0  # minutes that do not count: models, caches and rings fill
_STEER_EVERY = 30  # frames between two controls of a character
_FRAMES_PER_ACK = 4  # as the Python client does
_SEATED = 3  # every so many-th character sits down


@dataclass
class Sampled:
    """Resident memory of the server's own process and of the one that steps, as they change."""

    minutes: list[float] = field(default_factory=list)
    server: list[float] = field(default_factory=list)  # [MB]
    worker: list[float] = field(default_factory=list)  # [MB]

    def take(self, process: psutil.Process, minutes: float) -> None:
        """One sample."""
        self.minutes.append(minutes)
        self.server.append(process.memory_info().rss / 1e6)
        self.worker.append(sum(child.memory_info().rss for child in process.children(recursive=True)) / 1e6)

    def slope(self, values: Sequence[float], since: float) -> float:
        """Least squares from `since` minutes on [MB a minute]; NaN for fewer than three samples."""
        times, sizes = np.array(self.minutes), np.array(values)
        counted = times >= since
        return float(np.polyfit(times[counted], sizes[counted], 1)[0]) if counted.sum() > 2 else float("nan")


async def live(stub: Any, number: int, seconds: float, goal: motion_pb2.Goal) -> int:
    """One character from creation to deletion; the number of its frames that were read."""
    rng = np.random.default_rng(number)
    created = await stub.CreateSession(motion_pb2.CreateSessionRequest(seed=number))
    name, call, frames = created.session.name, stub.Animate(), 0
    await call.write(motion_pb2.AnimateRequest(open=motion_pb2.Open(session=name)))
    if number % _SEATED == 0:
        await call.write(motion_pb2.AnimateRequest(control=motion_pb2.ControlInput(control_id=1, goal=goal)))
    end, controls = time.monotonic() + seconds, 1
    while time.monotonic() < end:
        response = await call.read()
        if not response.HasField("frame"):
            continue
        frames += 1
        if frames % _FRAMES_PER_ACK == 1:
            ack = motion_pb2.Ack(sequence=response.frame.sequence)
            await call.write(motion_pb2.AnimateRequest(ack=ack))
        if number % _SEATED and frames % _STEER_EVERY == 1:
            controls += 1
            x, z = rng.uniform(-1.5, 1.5, 2)
            steer = motion_pb2.ControlInput(control_id=controls, steer=motion_pb2.Steer(velocity_x=x, velocity_z=z))
            await call.write(motion_pb2.AnimateRequest(control=steer))
    call.cancel()
    await stub.DeleteSession(motion_pb2.DeleteSessionRequest(name=name))
    return frames


async def soak(server: ServerProcess, minutes: float, sessions: int, life: float, every: float) -> dict[str, Any]:
    """The figures of so many minutes; characters live for `life` seconds on average, memory is read `every` [s]."""
    goal, numbers, sampled = chair_goal(), count(1), Sampled()
    began = time.monotonic()
    end = began + 60 * minutes
    totals = {"characters": 0, "frames": 0}

    async def reader(stub: Any) -> None:
        while time.monotonic() < end:
            number = next(numbers)
            seconds = float(np.random.default_rng(number).uniform(0.5, 1.5)) * life
            frames = await live(stub, number, min(seconds, max(1.0, end - time.monotonic())), goal)
            totals["frames"] += frames
            totals["characters"] += 1

    async def sample() -> None:
        process = psutil.Process(server.process.pid)
        while (now := time.monotonic()) < end:
            sampled.take(process, (now - began) / 60)
            await asyncio.sleep(every)

    async with grpc.aio.insecure_channel(server.grpc) as channel:
        stub = motion_pb2_grpc.MotionServiceStub(channel)
        await asyncio.gather(sample(), *(reader(stub) for _ in range(sessions)))
    since = min(_WARM, minutes / 3)
    return {
        "minutes": minutes,
        "sessions": sessions,
        "life_seconds": life,
        **totals,
        "counted_from_minute": since,
        "server_mb": [sampled.server[0], sampled.server[-1]],
        "worker_mb": [sampled.worker[0], sampled.worker[-1]],
        "server_mb_per_minute": sampled.slope(sampled.server, since),
        "worker_mb_per_minute": sampled.slope(sampled.worker, since),
        "server_mb_per_minute_second_half": sampled.slope(sampled.server, max(since, minutes / 2)),
        "worker_mb_per_minute_second_half": sampled.slope(sampled.worker, max(since, minutes / 2)),
        "samples": [
            [round(value, 2) for value in row]
            for row in zip(sampled.minutes, sampled.server, sampled.worker, strict=True)
        ],
    }


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate soak", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--minutes", type=float, default=60.0, help="length of the run")
    parser.add_argument("--sessions", type=int, default=16, help="readers at once")
    parser.add_argument("--life", type=float, default=20.0, help="how long a character lives on average [s]")
    parser.add_argument("--every", type=float, default=5.0, help="time between two samples of the memory [s]")
    parser.add_argument("--json", type=Path, help="write all figures here")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> None:
    """Runs it."""
    options = parse(argv)
    with motion_servers() as [server]:
        figures = asyncio.run(soak(server, options.minutes, options.sessions, options.life, options.every))
    for key, value in figures.items():
        if key != "samples":
            print(f"{key}: {value:.3g}" if isinstance(value, float) else f"{key}: {value}")
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
