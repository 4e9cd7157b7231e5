"""Seeded choices for the furniture builders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

T = TypeVar("T")


@dataclass(frozen=True)
class Dice:
    """A random source whose calls read like a recipe."""

    random: np.random.Generator

    @staticmethod
    def seeded(*key: int) -> Dice:
        return Dice(np.random.default_rng(list(key)))

    def between(self, low: float, high: float) -> float:
        """Uniform number in [low, high)."""
        return float(self.random.uniform(low, high))

    def chance(self, probability: float) -> bool:
        return bool(self.random.random() < probability)

    def count(self, low: int, high: int) -> int:
        """Whole number, both ends included."""
        return int(self.random.integers(low, high + 1))

    def pick(self, options: Sequence[T]) -> T:
        return options[int(self.random.integers(len(options)))]
