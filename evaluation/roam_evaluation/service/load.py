"""`roam evaluate load`: how many characters one motion server carries in real time, and how evenly their frames come.

Every session has one reader, as a game would have: Animate, REALTIME, snorm16, acknowledging. Readers run in
this process, the server in another; on a machine with few processors they take time from each other.

    python -m roam_evaluation.service.load [--sessions 1,8,32,64] [--seconds 10] [--seated 3] [--json FILE]
"""

import argparse
import asyncio
import json
import platform
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import grpc
import httpx
import numpy as np
import psutil
from roam.v1 import motion_pb2, motion_pb2_grpc, skeleton_pb2
from roam_goalpose.api.messages import pose_message, volume_message
from roam_goalpose.objects import load_shape
from roam_goalpose.objects.footprint import footprint
from roam_goalpose.objects.volume import shape_volume
from roam_goalpose.synthesis import GoalPoseRequest, Synthesizer, SynthesizerSettings
from roam_serving.shipped import OBJECTS

from roam_evaluation.service.frame_encoding import measure_encoding
from roam_evaluation.service.server_process import ServerProcess, motion_servers
from roam_evaluation.service.takeover import measure_stall, measure_takeovers

_RATE = 30.0  # [Hz]
_FRAMES_PER_ACK = 4  # as the Python client does
_CHAIR = OBJECTS / "chair.glb"
_CHAIR_AT = np.array([0.0, 0.0, -1.2], np.float32)  # [m]
_SETTLING = 1.0  # the first second of every stream is not counted [s]


@dataclass
class Reader:
    """What one reader saw."""

    first_frame: float = 0.0  # from opening the stream [s]
    times: list[float] = field(default_factory=list)
    sequences: list[int] = field(default_factory=list)
    skipped: int = 0

    def interval_errors(self) -> np.ndarray:
        """How far the time between two frames is from what their sequences say [s]."""
        times, sequences = np.array(self.times), np.array(self.sequences)
        counted = times > times[0] + _SETTLING
        return np.diff(times[counted]) - np.diff(sequences[counted]) / _RATE


async def read(stub: Any, seconds: float, delay: float, order: motion_pb2.ControlInput) -> Reader:
    """A character that does what it is ordered, read for some seconds."""
    await asyncio.sleep(delay)
    created = await stub.CreateSession(motion_pb2.CreateSessionRequest())
    name, reader = created.session.name, Reader()
    call = stub.Animate()
    encodings = [motion_pb2.ROTATION_ENCODING_SNORM16]
    began = time.perf_counter()
    await call.write(_request(open=motion_pb2.Open(session=name, rotation_encodings=encodings)))
    await call.write(_request(control=order))
    while time.perf_counter() < began + seconds:
        response = await call.read()
        now = time.perf_counter()
        if response.HasField("event"):
            reader.skipped += response.event.skipped_count
        if response.HasField("frame"):
            reader.first_frame = reader.first_frame or now - began
            reader.times.append(now)
            reader.sequences.append(response.frame.sequence)
            if len(reader.times) % _FRAMES_PER_ACK == 1:
                await call.write(_request(ack=motion_pb2.Ack(sequence=response.frame.sequence)))
    call.cancel()
    await stub.DeleteSession(motion_pb2.DeleteSessionRequest(name=name))
    return reader


def _steps(server: ServerProcess) -> tuple[float, float]:
    """Seconds spent in batched steps so far, and their number, as the server's metrics tell."""
    lines = (line.split() for line in httpx.get(f"{server.http}/metrics").text.splitlines())
    values = {
        words[0]: float(words[1]) for words in lines if words and words[0].startswith("roam_motion_step_seconds_")
    }
    return values["roam_motion_step_seconds_sum"], values["roam_motion_step_seconds_count"]


def _request(**message: object) -> motion_pb2.AnimateRequest:
    return motion_pb2.AnimateRequest(**message)  # type: ignore[arg-type]


async def load(
    server: ServerProcess, sessions: int, seconds: float, goal: motion_pb2.Goal | None = None, every: int = 0
) -> dict[str, float]:
    """The figures of so many sessions at once; times in milliseconds. Every so many-th one walks to `goal` and stays
    there, the others walk on."""
    walk = motion_pb2.ControlInput(control_id=1, steer=motion_pb2.Steer(velocity_z=1.0))
    sit = motion_pb2.ControlInput(control_id=1, goal=goal)
    orders = [sit if every and i % every == 0 else walk for i in range(sessions)]
    async with grpc.aio.insecure_channel(server.grpc) as channel:
        stub = motion_pb2_grpc.MotionServiceStub(channel)
        stepped, steps = _steps(server)
        before, own, began = server.processor_seconds(), time.process_time(), time.perf_counter()
        readers = await asyncio.gather(
            *(read(stub, seconds, 0.5 * i / sessions, order) for i, order in enumerate(orders))
        )
        busy, own = server.processor_seconds() - before, time.process_time() - own
        elapsed = time.perf_counter() - began
        stepped, steps = (after - first for after, first in zip(_steps(server), (stepped, steps), strict=True))
    errors = np.abs(np.concatenate([reader.interval_errors() for reader in readers])) * 1e3
    first = np.array([reader.first_frame for reader in readers]) * 1e3
    frames = sum(len(reader.times) for reader in readers)
    moved = sum(reader.sequences[-1] - reader.sequences[0] for reader in readers)
    lasted = sum(reader.times[-1] - reader.times[0] for reader in readers)
    return {
        "sessions": sessions,
        "seated": orders.count(sit) if every else 0,
        "frames_per_session_second": moved / lasted,
        "step": stepped / steps * 1e3,
        "interval_error_p50": float(np.percentile(errors, 50)),
        "interval_error_p95": float(np.percentile(errors, 95)),
        "interval_error_p99": float(np.percentile(errors, 99)),
        "interval_error_worst": float(errors.max()),
        "first_frame_p50": float(np.percentile(first, 50)),
        "first_frame_p99": float(np.percentile(first, 99)),
        "skipped_frames": sum(reader.skipped for reader in readers),
        "server_processors": busy / elapsed,
        "server_ms_per_frame": busy / frames * 1e3,
        "sessions_per_processor": frames / busy / _RATE,
        "server_memory_mb": server.memory() / 1e6,
        "load_average": psutil.getloadavg()[0],
        "client_processors": own / elapsed,
    }


def chair_goal() -> motion_pb2.Goal:
    """The bundled chair's goal pose, and the chair to keep out of, a step in front of where characters begin."""
    shape = load_shape(_CHAIR.read_bytes(), "glb")
    pose = Synthesizer.load(SynthesizerSettings()).synthesize(shape, GoalPoseRequest(action="sit")).pose
    outlines = [(corners + _CHAIR_AT[::2]).ravel().tolist() for corners in footprint(shape.points)]
    volume = volume_message(shape_volume(shape))
    volume.origin[:] = (np.array(volume.origin) + _CHAIR_AT).tolist()
    return motion_pb2.Goal(
        pose=pose_message(pose.moved(_CHAIR_AT)),
        action=skeleton_pb2.ACTION_SIT,
        obstacles=[skeleton_pb2.Outline(corners=corners) for corners in outlines],
        volume=volume,
    )


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(prog="roam evaluate load", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--sessions", default="1,8,16,32,64", help="how many at once, one run each")
    parser.add_argument("--seconds", type=float, default=10.0, help="length of a run")
    parser.add_argument("--seated", type=int, default=0, metavar="N", help="then again, every N-th on a chair")
    parser.add_argument("--takeovers", type=int, default=0, help="so often kill the owner; needs redis-server")
    parser.add_argument("--stall", type=float, default=25.0, help="so long a reader stops reading [s]; 0: none does")
    parser.add_argument("--json", type=Path, help="write all figures here")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> None:
    """Runs it."""
    options = parse(argv)
    figures: dict[str, object] = {
        "machine": f"{platform.machine()}, {psutil.cpu_count()} processors, {platform.system()}",
        "load_average_before": psutil.getloadavg()[0],
        "encoding": measure_encoding(),
    }
    _show("encoding", figures["encoding"])
    with motion_servers() as [server]:
        runs, counts = [], list(map(int, options.sessions.split(",")))
        for count in counts:
            runs.append(asyncio.run(load(server, count, options.seconds)))
            _show("load", runs[-1])
        figures["load"] = runs
        if options.seated:
            seated = partial(load, goal=chair_goal(), every=options.seated)
            runs += [asyncio.run(seated(server, count, 2 * options.seconds)) for count in counts]
            for run in runs[len(counts) :]:
                _show("load", run)
        if options.stall:
            figures["stalled_reader"] = measure_stall(server, options.stall)
            _show("stalled reader", figures["stalled_reader"])
    if options.takeovers:
        figures["takeover"] = measure_takeovers(options.takeovers)
        _show("takeover", figures["takeover"])
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")


def _show(title: str, figures: object) -> None:
    assert isinstance(figures, dict)
    told = (f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}" for key, value in figures.items())
    print(f"{title}: {', '.join(told)}", flush=True)


if __name__ == "__main__":
    main()
