"""`roam evaluate throughput`: goal poses of a server whose requests come at once, against the same one after another.

Both halves run in one go on the same server, so that the ratio holds on a busy machine too: a real server on loopback,
asked over gRPC, every request a different one (its own seed, none from the cache).
"""

import argparse
import asyncio
import json
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from roam_client import AsyncClient, Object
from roam_goalpose.app import goalpose_server
from roam_goalpose.settings import GoalPoseSettings
from roam_serving.server import Addresses
from roam_serving.shipped import OBJECTS


async def _timed(client: AsyncClient, place: Object, seeds: Sequence[int], *, reference: str, together: bool) -> float:
    """Seconds until all seeds have their pose."""
    start = time.perf_counter()
    if together:
        await asyncio.gather(*(client.synthesize(place, reference=reference, seed=seed) for seed in seeds))
    else:
        for seed in seeds:
            await client.synthesize(place, reference=reference, seed=seed)
    return time.perf_counter() - start


async def measure(addresses: Addresses, source: Path, *, requests: int, rounds: int, reference: str) -> dict[str, Any]:
    """Alternates both ways `rounds` times, after one pose that warms every process up; the sums and their ratio."""
    one, many = 0.0, 0.0
    async with AsyncClient(goalpose=addresses.grpc, timeout=120) as client:
        place = await client.upload(source)
        await _timed(client, place, range(requests), reference=reference, together=True)
        for turn in range(1, rounds + 1):
            first = 2 * turn * requests
            one += await _timed(client, place, range(first, first + requests), reference=reference, together=False)
            first += requests
            many += await _timed(client, place, range(first, first + requests), reference=reference, together=True)
    return {
        "requests": requests * rounds,
        "sequential_seconds": one,
        "concurrent_seconds": many,
        "sequential_per_second": requests * rounds / one,
        "concurrent_per_second": requests * rounds / many,
        "ratio": one / many,
    }


async def _run(arguments: argparse.Namespace) -> dict[str, Any]:
    settings = GoalPoseSettings(workers=arguments.workers, queue_limit=max(16, arguments.requests))
    async with goalpose_server(settings) as addresses:
        figures = await measure(
            addresses,
            arguments.object,
            requests=arguments.requests,
            rounds=arguments.rounds,
            reference=arguments.reference,
        )
    load = os.getloadavg()[0]
    return {"workers": arguments.workers, "cores": os.cpu_count(), "load_average": load, **figures}


def main(arguments: list[str] | None = None) -> None:
    """See --help."""
    parser = argparse.ArgumentParser(prog="roam evaluate throughput", description=__doc__)
    parser.add_argument("--object", type=Path, default=OBJECTS / "chair.glb")
    parser.add_argument("--reference", default="chair_sit")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes of the server")
    parser.add_argument("--requests", type=int, default=8, help="that come at once")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--json", type=Path, help="also write the figures there")
    chosen = parser.parse_args(arguments)
    figures = asyncio.run(_run(chosen))
    for name, value in figures.items():
        print(f"{name:<24} {value:.3f}" if isinstance(value, float) else f"{name:<24} {value}")
    if chosen.json:
        chosen.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
