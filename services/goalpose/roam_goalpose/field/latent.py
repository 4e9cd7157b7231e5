"""What the encoder knows about one object, ready for any number of queries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import torch
from torch import Tensor


@dataclass(frozen=True, eq=False)
class Latent:
    """Codes of a batch of B objects; `frame`, `anchors` and the vectors in `local` turn with it."""

    center: Tensor
    """`[B, 3]` mean of the surface points [m]; queries are taken relative to it."""
    frame: Tensor
    """`[B, 3, G]` global vectors; inner products with a query tell where on the object it is."""
    biases: Tensor
    """`[B, L, H]` the part of every decoder layer that is the same for all queries of an object."""
    anchors: Tensor
    """`[B, M, 3]` surface points, relative to the centre [m]."""
    local: Tensor
    """`[B, heads, M, S + 4 K + 3]` per anchor: scalars, K vectors, their products with the anchor, its place."""

    def to(self, dtype: torch.dtype) -> Latent:
        """The same codes in another precision."""
        return Latent(*(getattr(self, f.name).to(dtype) for f in fields(self)))

    def pick(self, index: Tensor) -> Latent:
        """Codes of some of the objects, in the order of `index` `[B']`; repeats are allowed."""
        return Latent(*(getattr(self, f.name)[index] for f in fields(self)))

    def expand(self, count: int) -> Latent:
        """One object's codes seen as a batch of `count`, without copying.

        Raises:
            ValueError: the batch holds more than one object.
        """
        if len(self.center) != 1:
            raise ValueError(f"only a latent of one object can be expanded, this one holds {len(self.center)}")
        return Latent(*(getattr(self, f.name).expand(count, *getattr(self, f.name).shape[1:]) for f in fields(self)))


def latent_concat(latents: Sequence[Latent]) -> Latent:
    """Codes of several batches of objects as one batch."""
    return Latent(*(torch.cat([getattr(latent, f.name) for latent in latents]) for f in fields(Latent)))
