"""What captured people do while they sit: a table of small movements, played from where the clock is in it.

Made by `training/data/seated_life.py` from captured sittings of eight people; the data were obtained from
mocap.cs.cmu.edu, created with funding from NSF EIA-0196217.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

TABLE = Path(__file__).parent / "seated_life.npz"
RATE = 15.0  # [Hz] of its rows
BONES = ("hips", "spine", "chest", "upperChest", "neck", "head", "leftShoulder", "rightShoulder")
WRISTS = ("leftHand", "rightHand")
TURNS = 3 * len(BONES)  # columns


@dataclass(frozen=True)
class Fidget:
    """How B seated bodies are moved, in their own frames (left, up, ahead)."""

    turns: Tensor  # [B, K, 3] of BONES [rad]
    hips: Tensor  # [B, 3] [m]
    wrists: Tensor  # [B, 2, 3] [m]


@cache
def _table() -> Tensor:
    """[N + 1, C]: the last row is the first again."""
    with np.load(TABLE) as stored:
        values = stored["values"].astype(np.float32) * stored["scale"]
    return torch.from_numpy(np.concatenate([values, values[:1]]))


def fidget(clock: Tensor) -> Fidget:
    """What the table says at the clocks [B] [s]; it begins anew at its end."""
    rows = _table()
    count = len(rows) - 1
    at = torch.remainder(clock * RATE, count)
    before = at.floor()
    here = before.long().clamp(0, count - 1)
    now = torch.lerp(rows[here], rows[here + 1], (at - before)[:, None])
    turns, hips, wrists = now.split([TURNS, 3, 6], 1)
    return Fidget(turns.unflatten(1, (-1, 3)), hips, wrists.unflatten(1, (2, 3)))
