"""Batches of augmented clouds and labelled queries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from roam_goalpose.training.scans import scan
from roam_goalpose.training.store import Store

NO_FRONT = frozenset({"stool", "barstool"})
"""Categories on which no side is the front, so that nothing about it is asked."""
CLOUD_SIZES = (500, 640, 800, 1024, 1500, 1500)
UNIFORM_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Batch:
    """B clouds of N points with Q labelled queries each, in canonical frames [m]."""

    points: Tensor
    """`[B, N, 3]`"""
    queries: Tensor
    """`[B, Q, 3]`"""
    inside: Tensor
    """`[B, Q]` 0 or 1"""
    distance: Tensor
    """`[B, Q]` signed, in units of 10 cm, clipped to −1…3"""
    place: Tensor
    """`[B, Q, 3]` distance to the mirror plane, height over the seat, distance to the front of the middle [m]"""
    place_known: Tensor
    """`[B, 1, 3]` 0 or 1"""


@dataclass(frozen=True, eq=False)
class Source:
    """A store with its share of the batch and how much its shapes may be stretched per axis."""

    store: Store
    share: float
    stretch: float


def draw(sources: Sequence[Source], random: np.random.Generator, *, size: int, queries: int) -> Batch:
    """A batch of `size` augmented examples, the source of each drawn by share."""
    shares = np.array([source.share for source in sources])
    count = int(random.choice(CLOUD_SIZES))
    rows: list[tuple[NDArray[np.float32], ...]] = []
    for which in random.choice(len(sources), size, p=shares / shares.sum()):
        rows.append(_example(sources[which], random, count, queries))
    return Batch(*(torch.from_numpy(np.stack(column).astype(np.float32)) for column in zip(*rows, strict=True)))


def _example(source: Source, random: np.random.Generator, count: int, queries: int) -> tuple[NDArray[np.float32], ...]:
    store, row = source.store, int(random.integers(len(source.store)))
    scale = np.exp(random.uniform(-np.log(source.stretch), np.log(source.stretch), 3)).astype(np.float32)
    mirror = np.array([random.choice([-1.0, 1.0]), 1.0, 1.0], dtype=np.float32)
    cloud = scan(store.surface[row].astype(np.float32) * scale, store.normals[row], random, count) * mirror
    chosen = choose_queries(random, store.queries.shape[1], queries)
    points = store.queries[row, chosen].astype(np.float32) * scale
    # Stretching an axis changes distances by something between the factors; the sign stays exact.
    distance = store.distance[row, chosen].astype(np.float32) * np.cbrt(scale.prod())
    place, known = places(points, store, row, scale[1])
    return cloud, points * mirror, (distance < 0).astype(np.float32), np.clip(distance * 10, -1, 3), place, known


def choose_queries(random: np.random.Generator, stored: int, count: int) -> NDArray[np.int64]:
    """Rows of `count` queries, in their stored halves: uniform in the box, near the surface."""
    uniform = int(count * UNIFORM_SHARE)
    near = random.integers(stored // 2, stored, count - uniform)
    return np.concatenate([random.integers(0, stored // 2, uniform), near])


def places(
    points: NDArray[np.float32], store: Store, row: int, scale_y: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where the points lie on the object `[Q, 3]`, and which of the three numbers are known `[1, 3]`."""
    seat = store.seat_heights[row] * scale_y
    known = np.array([[1.0, float(np.isfinite(seat)), float(store.categories[row] not in NO_FRONT)]], dtype=np.float32)
    height = points[:, 1] - (seat if np.isfinite(seat) else 0.0)
    return np.stack([np.abs(points[:, 0]), height, points[:, 2]], -1).astype(np.float32), known
