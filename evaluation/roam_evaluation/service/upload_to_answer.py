"""From a file to its goal pose through a warm server on loopback: for every object of a folder, and as a mesh grows.

Both halves run against one server. The growing mesh is one chair whose triangles are split again and again, so that
only their number changes.

    python -m roam_evaluation.service.upload_to_answer --objects DIR [--json FILE]
"""

import argparse
import asyncio
import json
import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import trimesh
from roam_client import AsyncClient, RoamError
from roam_goalpose.app import goalpose_server
from roam_goalpose.settings import GoalPoseSettings
from roam_serving.shipped import OBJECTS

_CHAIR = OBJECTS / "chair.glb"
_MOST_TRIANGLES = 400_000
_FORMATS = ("obj", "off", "stl", "ply", "glb", "gltf")


async def _answered(client: AsyncClient, source: Path, seed: int) -> tuple[float, float]:
    """Seconds that the upload took, and from its beginning to the pose."""
    start = time.perf_counter()
    place = await client.upload(source)
    uploaded = time.perf_counter() - start
    await client.synthesize(place, seed=seed)
    return uploaded, time.perf_counter() - start


async def _folder(client: AsyncClient, folder: Path) -> dict[str, float]:
    """The median and the slowest of every object in a folder that can be sat on."""
    taken = []
    for source in sorted(path for path in folder.iterdir() if path.suffix[1:] in _FORMATS):
        try:
            taken.append(await _answered(client, source, seed=0))
        except RoamError as error:
            print(f"{source.name}: {error}")
    uploads, whole = np.array(taken).T
    return {
        "objects": len(taken),
        "upload_median": float(np.median(uploads)),
        "median": float(np.median(whole)),
        "p95": float(np.percentile(whole, 95)),
        "worst": float(whole.max()),
    }


async def _growing(client: AsyncClient, rounds: int) -> list[dict[str, float]]:
    """Seconds by number of triangles: the least of some rounds, each with a seed of its own."""
    mesh, rows = trimesh.load_mesh(_CHAIR).subdivide(), []  # the chair itself is known
    with tempfile.TemporaryDirectory() as folder:
        while len(mesh.faces) <= _MOST_TRIANGLES:
            source = Path(folder) / f"{len(mesh.faces)}.glb"
            mesh.export(source)
            taken = np.array([await _answered(client, source, seed) for seed in range(1, rounds + 1)])
            upload, pose = taken[0, 0], (taken[:, 1] - taken[:, 0]).min()  # an upload that is known is quick
            rows.append({"triangles": len(mesh.faces), "upload": float(upload), "pose": float(pose)})
            mesh = mesh.subdivide()
    return rows


def _memory() -> float:
    """Resident memory of the largest process of the server [MB]."""
    own = psutil.Process(os.getpid())
    return max(process.memory_info().rss for process in (own, *own.children(recursive=True))) / 1e6


async def measure(folder: Path, rounds: int) -> dict[str, Any]:
    """All figures; seconds and megabytes."""
    async with goalpose_server(GoalPoseSettings()) as addresses, AsyncClient(goalpose=addresses.grpc) as client:
        for seed in range(rounds + 1):
            await _answered(client, _CHAIR, seed)  # warm
        figures = {"objects": await _folder(client, folder), "triangles": await _growing(client, rounds)}
        return figures | {"largest_process_mb": _memory(), "load_average": os.getloadavg()[0]}


def main(argv: Sequence[str] | None = None) -> None:
    """See --help."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--objects", type=Path, required=True, help="folder of meshes that the server has not seen")
    parser.add_argument("--rounds", type=int, default=3, help="of each size of mesh")
    parser.add_argument("--json", type=Path, help="write the figures there")
    chosen = parser.parse_args(argv)
    figures = asyncio.run(measure(chosen.objects, chosen.rounds))
    print(json.dumps(figures, indent=1))
    if chosen.json:
        chosen.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
