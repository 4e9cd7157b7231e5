"""What scanners and careless models leave of a cloud: parts missing, noise, few points.

Clouds are `[N, 3]` [m] in canonical frames; normals `[N, 3]` are those of the store, int8, zero on what bounds no body.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Cloud = NDArray[np.float32]
Normals = NDArray[np.int8]
Mask = NDArray[np.bool_]

UNDERSIDE = 0.28
"""Highest underside [m] that may be missing: up to there labels take what is open below for body (`labels.py`)."""
FACING = 64
"""Component of a normal, in units of 1/127, from which a surface faces a direction: 60 degrees."""
SIDE_SHARE, UNSEEN_SHARE, UNDERSIDE_SHARE, NOISE_SHARE = 0.1, 0.15, 0.25, 0.3
"""How many clouds trained on miss one side, all that faces one side, and the underside of bodies; and are noisy."""


def above_underside(cloud: Cloud, normals: Normals) -> Mask:
    """The points `[N]` that are left of bodies modelled without an underside."""
    return ~((normals[:, 1] < -FACING) & (cloud[:, 1] < UNDERSIDE))


def seen_but_from(normals: Normals, yaw: float) -> Mask:
    """The points `[N]` that are left when no camera stood at heading `yaw` [rad]."""
    return np.asarray(normals @ np.array([np.sin(yaw), 0.0, np.cos(yaw)]) < FACING)


def noisy(cloud: Cloud, random: np.random.Generator, deviation: float) -> Cloud:
    """The points with Gaussian noise of `deviation` [m] per axis."""
    return cloud + (deviation * random.standard_normal(cloud.shape)).astype(np.float32)


def scan(cloud: Cloud, normals: Normals, random: np.random.Generator, count: int) -> Cloud:
    """`count` of the points as training sees them: at times with parts missing, at times noisy (up to 1 cm)."""
    seen = np.ones(len(cloud), dtype=bool)
    if random.random() < UNDERSIDE_SHARE:
        seen &= above_underside(cloud, normals)
    if random.random() < UNSEEN_SHARE:
        seen &= seen_but_from(normals, random.uniform(-np.pi, np.pi))
    if random.random() < SIDE_SHARE:
        direction = random.standard_normal(3)
        along = cloud @ (direction / np.linalg.norm(direction)).astype(np.float32)
        seen &= along > np.quantile(along, random.uniform(0.05, 0.4))
    cloud = cloud[seen] if seen.any() else cloud
    cloud = cloud[random.choice(len(cloud), count, replace=len(cloud) < count)]
    return noisy(cloud, random, random.uniform(0.0, 0.01)) if random.random() < NOISE_SHARE else cloud


CLOUD = 1500
"""Points that the service gives the encoder, and that fields are measured with."""
Change = Callable[[Cloud, Normals, np.random.Generator], Cloud]
CHANGES: dict[str, Change] = {
    "plain": lambda cloud, normals, random: cloud[:CLOUD],
    "500 points": lambda cloud, normals, random: cloud[:500],
    "noise 1 cm": lambda cloud, normals, random: noisy(cloud[:CLOUD], random, 0.01),
    "back unseen": lambda cloud, normals, random: cloud[seen_but_from(normals, np.pi)][:CLOUD],
    "side unseen": lambda cloud, normals, random: cloud[seen_but_from(normals, np.pi / 2)][:CLOUD],
    "no underside": lambda cloud, normals, random: cloud[above_underside(cloud, normals)][:CLOUD],
}
"""What a cloud in random order is measured as."""
