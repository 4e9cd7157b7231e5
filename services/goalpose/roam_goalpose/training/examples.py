"""One training example: surface points, and query points with labels, of a real mesh or a generated piece."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from roam_goalpose.furniture import Furniture
from roam_goalpose.training.labels import label_mesh

Array = NDArray[np.float64]

SURFACE_POINTS = 6_000
QUERY_POINTS = 12_000
PADDING = 0.15
"""Free space [m] around the object in which queries are drawn; poses live there too."""
NEAR_SHARE = 0.5
"""Share of the queries that lie close to the surface."""
THICK = 0.03
"""What is solid so far [m] below its surface is a body; a thinner board has no side that a scan could miss alone."""


@dataclass(frozen=True, eq=False)
class Example:
    """Arrays of one object in its canonical frame (+Y up, facing +Z, standing on y = 0, box centred; metres)."""

    name: str
    category: str
    seat_height: float
    surface: NDArray[np.float16]
    """`[SURFACE_POINTS, 3]`"""
    normals: NDArray[np.int8]
    """`[SURFACE_POINTS, 3]` outward, in units of 1/127; zero on boards and on faces within a body."""
    queries: NDArray[np.float16]
    """`[QUERY_POINTS, 3]`: first the uniform half, then the half near the surface."""
    distance: NDArray[np.float16]
    """`[QUERY_POINTS]` signed distance [m], negative inside."""


def is_held_out(file_name: str) -> bool:
    """Whether a mesh of `train/` is kept for evaluation only: a fixed sixth or so by hash, some of every category."""
    digest = hashlib.sha256(f"3:{file_name}".encode()).digest()
    return digest[0] * 100 // 256 < 15


def draw_queries(surface: Array, bounds: Array, random: np.random.Generator) -> NDArray[np.float16]:
    """Query points `[QUERY_POINTS, 3]`: uniform in the padded box, then near the surface (σ 1, 3 and 8 cm)."""
    near = int(QUERY_POINTS * NEAR_SHARE)
    low, high = bounds[0] - PADDING, bounds[1] + PADDING
    uniform = random.uniform(low, high, (QUERY_POINTS - near, 3))
    sigma = random.choice([0.01, 0.03, 0.08], (near, 1))
    close = surface[random.integers(len(surface), size=near)] + sigma * random.standard_normal((near, 3))
    return np.concatenate([uniform, close]).astype(np.float16)


def body_normals(surface: Array, normals: Array, inside: Callable[[Array], NDArray[np.bool_]]) -> NDArray[np.int8]:
    """Outward normals `[N, 3]` in units of 1/127 of points `[N, 3]` on bodies; zero where both sides are alike.

    `normals` `[N, 3]` may point to either side; `inside` tells whether points lie in the object.
    """
    outwards = inside(surface - THICK * normals).astype(float) - inside(surface + THICK * normals)
    return np.rint(127 * normals * outwards[:, None]).astype(np.int8)


def from_furniture(piece: Furniture, *, name: str, seed: int) -> Example:
    """Example of a generated piece; the sign is exact, the magnitude that of the nearest of 20,000 surface points."""
    random = np.random.default_rng([1, seed])
    dense, normals = piece.sample_surface(20_000, seed=seed)
    surface = dense
    if random.random() < 0.3:  # uploads often contain hidden inner faces
        surface, normals = piece.sample_surface(SURFACE_POINTS, seed=seed, hidden=True)
    surface, normals = surface[:SURFACE_POINTS], normals[:SURFACE_POINTS]
    queries = draw_queries(dense, piece.bounds, random)
    points = queries.astype(np.float64)
    distance = np.maximum(cKDTree(dense).query(points)[0], 1e-3)
    signed = np.where(piece.occupancy(points), -distance, distance)
    outward, surface16 = body_normals(surface, normals, piece.occupancy), surface.astype(np.float16)
    return Example(name, piece.category, piece.seat_height, surface16, outward, queries, signed.astype(np.float16))


def from_mesh(path: Path, *, category: str, seat_height: float) -> Example:
    """Example of a mesh file in canonical form."""
    mesh = trimesh.load_mesh(path, process=False)
    seed = int.from_bytes(hashlib.sha256(path.name.encode()).digest()[:4], "little")
    random = np.random.default_rng([2, seed])
    labels = label_mesh(mesh, seed=seed)
    chosen = random.permutation(len(labels.samples))[:SURFACE_POINTS]
    surface = labels.samples[chosen]
    queries = draw_queries(surface, np.asarray(mesh.bounds), random)
    distance = labels.distance(queries.astype(np.float64)).astype(np.float16)
    outward = body_normals(surface, labels.normals[chosen], lambda points: labels.distance(points) < 0)
    return Example(path.name, category, seat_height, surface.astype(np.float16), outward, queries, distance)
