"""Weights of the energy terms, in SI units: lengths in metres, angles in radians; the total has no unit."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class EnergyWeights:
    """One weight per term by name; a term without one has weight 0: it is not computed.

    The registry's own weights are `terms.default_weights()`, those of the paper `terms.published_weights()`.
    """

    pairs: tuple[tuple[str, float], ...] = ()  # sorted by name, none of weight 0

    @classmethod
    def of(cls, weights: Mapping[str, float]) -> "EnergyWeights":
        """From a mapping."""
        return cls(tuple(sorted((name, float(weight)) for name, weight in weights.items() if weight)))

    def __getitem__(self, name: str) -> float:
        return next((weight for known, weight in self.pairs if known == name), 0.0)

    def __iter__(self) -> Iterator[str]:
        """Names of the terms that count."""
        return (name for name, _ in self.pairs)

    def changed(self, weights: Mapping[str, float]) -> "EnergyWeights":
        """With other weights for some terms."""
        return self.of(dict(self.pairs) | dict(weights))

    def without(self, *names: str) -> "EnergyWeights":
        """With some terms switched off."""
        return self.changed(dict.fromkeys(names, 0.0))

    def only(self, *names: str) -> "EnergyWeights":
        """With all other terms switched off."""
        return EnergyWeights(tuple(pair for pair in self.pairs if pair[0] in names))
