"""Sizes of the descriptor field."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class FieldConfig:
    """Numbers that fix the network's shape; stored beside the weights."""

    anchors: int = 128
    """Surface points that carry features; the rest of the cloud only shapes their neighbourhoods. 128 on a chair is
    one every 12 cm."""
    channels: int = 48
    scalars: int = 64
    shared: int = 32
    """Width of what a point tells its neighbours."""
    encoder_blocks: int = 3
    smoothing: float = 0.15
    """Reach [m] of the neighbourhood average between anchors."""
    frame: int = 64
    """Global vectors G (256 in the paper; the local features carry the detail here)."""
    heads: int = 2
    local_scalars: int = 32
    local_vectors: int = 12
    hidden: int = 128
    """Decoder width (256 in the paper): 0.33 MFLOP per query in all, since the solver asks for millions."""
    decoder_blocks: int = 3

    @property
    def local_width(self) -> int:
        """Numbers per anchor and head: scalars, vectors, vector-anchor products, anchor."""
        return self.local_scalars + 4 * self.local_vectors + 3

    @property
    def inputs(self) -> int:
        """Invariant numbers per query that enter the decoder."""
        return 2 + self.frame + self.heads * (2 + self.local_scalars + self.local_vectors)

    @property
    def descriptor(self) -> int:
        """Length of a descriptor: the inputs, then the activations of every hidden layer."""
        return self.inputs + (1 + self.decoder_blocks) * self.hidden
