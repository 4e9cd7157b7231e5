"""Who somebody is: a few numbers that a character keeps for life, by which its gait, stance and stillness differ.

Each is a deviate of its own: 0 is the mean of people, 1 a standard deviation, and nobody is farther than 1.645 from the
mean, so that every character is within people's 5 to 95 %. Training knows only the mean. What a deviate is worth is
said where it is used.
"""

import numpy as np
from torch import Tensor

NAMES = ("pace", "poise", "arms", "stance", "toes", "unrest", "breath", "hips", "height")
_FARTHEST = 1.645
_STREAM = 0x6D616E  # numbers of its own for every seed: those of stance and phase stay as they are


def drawn(seed: int) -> np.ndarray:
    """The manner of a seed [9], float32."""
    numbers = np.random.default_rng([_STREAM, seed]).standard_normal(len(NAMES))
    return np.clip(numbers, -_FARTHEST, _FARTHEST).astype(np.float32)


def of(manner: Tensor, name: str) -> Tensor:
    """One deviate [B] of a batch of manners [B, 9]."""
    return manner[:, NAMES.index(name)]
