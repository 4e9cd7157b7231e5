"""What readers notice when a replica is killed, and what one finds that stopped reading."""

import asyncio
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from socket import create_connection, socket
from subprocess import DEVNULL, Popen
from tempfile import TemporaryDirectory

import numpy as np
from roam_client import AsyncClient, Client, EventType, Frame

from roam_evaluation.service.server_process import ServerProcess, motion_servers

_BEFORE = 45  # frames until the kill
_AFTER = 30


def measure_takeovers(count: int) -> dict[str, float]:
    """Kills the owner of a REALTIME stream so often; seconds from the kill to the first frame that is new."""
    gaps = []
    with _redis() as url:
        for _ in range(count):
            with motion_servers(2, ["--session-store", url]) as servers:
                gaps.append(asyncio.run(_gap(servers)))
    return {"kills": count, "gap_median": float(np.median(gaps)), "gap_worst": max(gaps)}


async def _gap(servers: list[ServerProcess]) -> float:
    """One kill [s]. RuntimeError when the stream did not go on exactly."""
    both = "ipv4:" + ",".join(server.grpc for server in servers)
    killed, gap, sequences = 0.0, 0.0, [0]
    async with AsyncClient(motion=both) as client:
        session = await client.create_session()
        await session.steer(0.0, 1.0)
        async with session.stream(encoding="snorm16") as stream:
            async for frame in stream.frames():
                if killed and not gap and frame.sequence > sequences[-1]:
                    gap = time.perf_counter() - killed
                sequences.append(frame.sequence)
                if len(sequences) == _BEFORE:
                    servers[0].process.kill()
                    killed = time.perf_counter()
                if len(sequences) == _BEFORE + _AFTER:
                    break
            if not stream.header.exact or stream.header.discontinuity:
                raise RuntimeError("the stream went on, but not as the same motion")
        await session.delete()
    return gap


def measure_stall(server: ServerProcess, seconds: float) -> dict[str, float]:
    """A REALTIME reader of WatchFrames that stops reading: what it gets afterwards, and what it cost the server."""
    with Client(motion=server.grpc) as client, client.create_session() as session, session.watch() as stream:
        items = iter(stream)
        last = [item.sequence for item, _ in zip(items, range(30), strict=False)][-1]
        memory, stopped = server.memory(), time.perf_counter()
        time.sleep(seconds)
        grown = server.memory() - memory
        old, came_back = 0, time.perf_counter()
        for item in items:
            if isinstance(item, Frame):
                old += 1
            elif item.type is EventType.FRAMES_SKIPPED:
                break
        fresh = next(items).sequence
        at = time.perf_counter()
    due = last + (at - stopped) * session.frame_rate
    return {
        "stalled_seconds": seconds,
        "old_frames_read": old,
        "ms_until_a_fresh_frame": (at - came_back) * 1e3,
        "age_of_fresh_frame_ticks": due - fresh,
        "server_memory_grown_bytes": grown,
    }


@contextmanager
def _redis() -> Iterator[str]:
    """A Redis of its own. RuntimeError where there is none."""
    program = which("redis-server")
    if program is None:
        raise RuntimeError("--takeovers needs redis-server")
    with socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    with TemporaryDirectory() as folder:
        place = ["--port", str(port), "--bind", "127.0.0.1", "--dir", str(Path(folder)), "--save", ""]
        process = Popen([program, *place], stdout=DEVNULL)
        try:
            _wait_for(port)
            yield f"redis://127.0.0.1:{port}"
        finally:
            process.kill()
            process.wait()


def _wait_for(port: int) -> None:
    for _ in range(500):
        try:
            create_connection(("127.0.0.1", port)).close()
            return
        except ConnectionRefusedError:
            time.sleep(0.01)
    raise RuntimeError("redis-server does not answer")
