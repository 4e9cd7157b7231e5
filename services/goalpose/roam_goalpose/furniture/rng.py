"""Seeded choices for the furniture builders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

T = TypeVar("T")


@dataclass(frozen=True)
class Rng:
    """A random number generator whose calls read like a recipe."""

    generator: np.random.Generator

    @staticmethod
    def seeded(*key: int) -> Rng:
        """Equal keys draw equal numbers."""
        return Rng(np.random.default_rng(list(key)))

    def between(self, low: float, high: float) -> float:
        """Uniform number in [low, high)."""
        return float(self.generator.uniform(low, high))

    def chance(self, probability: float) -> bool:
        """True as often as `probability` says."""
        return bool(self.generator.random() < probability)

    def count(self, low: int, high: int) -> int:
        """Whole number, both ends included."""
        return int(self.generator.integers(low, high + 1))

    def pick(self, options: Sequence[T]) -> T:
        """One of them, each as often."""
        return options[int(self.generator.integers(len(options)))]
