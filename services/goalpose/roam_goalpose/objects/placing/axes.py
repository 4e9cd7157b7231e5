"""Turning a file's up axis to +Y without changing handedness."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from roam_goalpose.objects.errors import ObjectError
from roam_goalpose.objects.geometry import Array

# Rows: where file x, y, z go. Each is a proper rotation (determinant +1). For z the usual convention keeps x.
ROTATIONS: Mapping[str, tuple[tuple[int, int, int], ...]] = {
    "y": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "z": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "x": ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    "-y": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "-z": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "-x": ((0, 1, 0), (-1, 0, 0), (0, 0, 1)),
}


def check_up(name: str) -> str:
    """The canonical axis name (`y`, `-z`, …; a leading `+` is dropped); raises OBJECT_UP_UNKNOWN."""
    up = name.strip().lower().removeprefix("+")
    if up not in ROTATIONS:
        raise ObjectError(
            "OBJECT_UP_UNKNOWN",
            field="up",
            message=f"The up axis {name[:40]!r} is not known.",
            remedy=f"Give one of {', '.join(ROTATIONS)}, or leave it out to have it detected.",
        )
    return up


def up_rotation(up: str) -> Array:
    """The proper rotation `[3, 3]` that takes file axis `up` to +Y (acts on column vectors)."""
    return np.array(ROTATIONS[up], dtype=np.float64)
