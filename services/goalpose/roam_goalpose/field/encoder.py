"""Point cloud → latent codes (paper 3.1.1, Φ): a vector-neuron PointNet on anchor points.

Rotation-safe by construction: the cloud is centred on the mean of its points, the scale is the metre, and from there on
only channels are mixed (vectors) or invariants are transformed (scalars).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from roam_goalpose.field.config import FieldConfig
from roam_goalpose.field.latent import Latent


def lengths(vectors: Tensor) -> Tensor:
    """Invariant lengths `[B, N, C]` of vector features `[B, 3, N, C]`."""
    return torch.sqrt((vectors * vectors).sum(1) + 1e-8)


class VectorBlock(nn.Module):
    """One residual step on vectors `[B, 3, N, C]` and the invariant scalars `[B, N, F]` that travel with them.

    Each point sees itself, the smoothed features of its neighbourhood and the mean of the object. Vectors are mixed
    linearly without bias and scaled by gates computed from invariants: a non-linearity that needs fewer passes over
    the vectors than projecting them on learned directions.
    """

    def __init__(self, channels: int, scalars: int, shared: int) -> None:
        super().__init__()
        self.share_vectors = nn.Linear(channels, shared, bias=False)
        self.share_scalars = nn.Linear(scalars, shared)
        self.mix = nn.Linear(channels + shared, channels, bias=False)
        self.mix_mean = nn.Linear(channels, channels, bias=False)
        self.scalar_in = nn.Linear(scalars + shared + channels, scalars)
        self.scalar_mean = nn.Linear(scalars, scalars)
        self.scalar_out = nn.Linear(scalars, scalars)
        self.gate = nn.Linear(scalars, channels)
        self.out = nn.Linear(channels, channels, bias=False)

    def forward(self, vectors: Tensor, scalars: Tensor, smoothing: Tensor) -> tuple[Tensor, Tensor]:
        """`smoothing` `[B, N, N]` averages over neighbourhoods (rows sum to one)."""
        near_vectors = smoothing[:, None] @ self.share_vectors(vectors)
        near_scalars = smoothing @ self.share_scalars(scalars)
        mixed = self.mix(torch.cat([vectors, near_vectors], -1)) + self.mix_mean(vectors.mean(2, keepdim=True))
        inner = torch.cat([scalars, near_scalars, lengths(mixed)], -1)
        hidden = torch.relu(self.scalar_in(inner) + self.scalar_mean(scalars.mean(1, keepdim=True)))
        gated = mixed * torch.sigmoid(self.gate(hidden))[:, None]
        return vectors + self.out(gated), scalars + self.scalar_out(hidden)


SCALES = (0.2, 0.1, 0.05)
"""Standard deviations [m] of the neighbourhoods; each is half the one before, so its weights are the fourth power."""
CANDIDATES = 4
"""Points among which each anchor is chosen, so that anchors do not leave holes. More would spread them little better,
and each is one more chance that the rounding of a turned upload decides between two."""
VECTOR_INPUTS = 1 + 3 * len(SCALES)
SCALAR_INPUTS = 1 + 3 * len(SCALES)


class Encoder(nn.Module):
    """Φ: cloud `[B, N, 3]` [m] → `Latent`."""

    def __init__(self, config: FieldConfig) -> None:
        super().__init__()
        c = self.config = config
        self.vectors_in = nn.Linear(VECTOR_INPUTS, c.channels, bias=False)
        self.scalars_in = nn.Linear(SCALAR_INPUTS + VECTOR_INPUTS, c.scalars)
        self.blocks = nn.ModuleList(VectorBlock(c.channels, c.scalars, c.shared) for _ in range(c.encoder_blocks))
        self.frame = nn.Linear(c.channels, c.frame, bias=False)
        self.frame_twin = nn.Linear(c.frame, c.frame, bias=False)
        pooled = 2 * c.scalars + 2 * c.frame
        self.summary = nn.Sequential(nn.Linear(pooled, c.hidden), nn.ReLU())
        self.biases = nn.Linear(c.hidden, (1 + c.decoder_blocks) * c.hidden)
        self.local_scalars = nn.Linear(c.scalars, c.heads * c.local_scalars)
        self.local_vectors = nn.Linear(c.channels, c.heads * c.local_vectors, bias=False)

    def forward(self, points: Tensor) -> Latent:
        center = points.mean(1)
        cloud = points - center[:, None]
        with torch.no_grad():
            chosen = spread(cloud, self.config.anchors)[..., None].expand(-1, -1, 3)
            anchors = cloud.gather(1, chosen)
            # Covariances are small differences of large moments: in float32 a turned upload differs by up to 7e-5 in
            # its descriptors, in float64 by 6e-6. Training does not need that and is quicker without.
            wide = cloud if self.training else cloud.double()
            raw = neighbourhoods(wide.gather(1, chosen), wide)
            raw_vectors, raw_scalars = raw[0].to(cloud.dtype), raw[1].to(cloud.dtype)
            closeness = squared_distances(anchors, anchors).mul_(-0.5 / self.config.smoothing**2)
            smoothing = torch.softmax(closeness, -1)
        vectors = self.vectors_in(raw_vectors)
        scalars = torch.relu(self.scalars_in(torch.cat([raw_scalars, lengths(raw_vectors)], -1)))
        for block in self.blocks:
            vectors, scalars = block(vectors, scalars, smoothing)
        frame, biases = self._globals(vectors, scalars)
        return Latent(center, frame, biases, anchors, self._locals(vectors, scalars, anchors))

    def _globals(self, vectors: Tensor, scalars: Tensor) -> tuple[Tensor, Tensor]:
        frame = self.frame(vectors.mean(2))  # [B, 3, G]
        products = (frame * self.frame_twin(frame)).sum(1)  # the latent's products with a learned map of itself
        norms = torch.sqrt((frame * frame).sum(1) + 1e-8)
        summary = self.summary(torch.cat([scalars.mean(1), scalars.amax(1), products, norms], -1))
        return frame, self.biases(summary).unflatten(-1, (1 + self.config.decoder_blocks, self.config.hidden))

    def _locals(self, vectors: Tensor, scalars: Tensor, anchors: Tensor) -> Tensor:
        c, (batch, count, _) = self.config, anchors.shape
        own = self.local_scalars(scalars).view(batch, count, c.heads, c.local_scalars)
        turning = self.local_vectors(vectors).view(batch, 3, count, c.heads, c.local_vectors)
        products = (turning * anchors.transpose(1, 2)[..., None, None]).sum(1)
        flat = turning.permute(0, 2, 3, 1, 4).reshape(batch, count, c.heads, 3 * c.local_vectors)
        place = anchors[:, :, None].expand(-1, -1, c.heads, -1)
        return torch.cat([own, flat, products, place], -1).transpose(1, 2)


@torch.no_grad()
def spread(cloud: Tensor, count: int) -> Tensor:
    """Rows `[B, count]` of points `[B, N, 3]` in random order that lie apart from each other (Mitchell's candidates).

    Each is, of a few candidates, the one farthest from all before. The first `count` points as they come, or all of
    them spread by area, leave holes of several times the usual gap in a seat, and the field then sees holes there.
    """
    batch, total, _ = cloud.shape
    count = min(count, total)
    choices = max(1, min(CANDIDATES, total // count))
    rows = torch.arange(choices * count, device=cloud.device).view(choices, count)
    wide = cloud[:, : choices * count].double()
    apart = torch.cdist(wide, wide, compute_mode="donot_use_mm_for_euclid_dist")
    nearest = apart[:, 0].clone()
    chosen, every = [rows[0, :1].expand(batch)], torch.arange(batch, device=cloud.device)
    for k in range(1, count):
        best = nearest[:, rows[:, k]].argmax(-1)
        chosen.append(rows[best, k])
        torch.minimum(nearest, apart[every, chosen[-1]], out=nearest)
    return torch.stack(chosen, 1)


def squared_distances(a: Tensor, b: Tensor) -> Tensor:
    """`[B, M, N]` squared distances of points `[B, M, 3]` and `[B, N, 3]`, by one matrix product."""
    squares = (a * a).sum(-1)[..., None] + (b * b).sum(-1)[:, None]
    return torch.baddbmm(squares, a, b.transpose(1, 2), alpha=-2).clamp_(min=0.0)


def neighbourhoods(anchors: Tensor, cloud: Tensor) -> tuple[Tensor, Tensor]:
    """What each anchor sees around it, at three scales.

    Vectors `[B, 3, M, 10]`: its position; its offset to the neighbourhood's mean; the neighbourhood's covariance
    applied to the position and to the widest offset (both lean towards the surface's directions).
    Scalars `[B, M, 10]`: radius, density, spread and flatness.
    """
    weight = torch.exp(squared_distances(anchors, cloud).mul_(-0.5 / SCALES[0] ** 2))
    x, y, z = cloud.unbind(-1)
    moments = torch.stack([torch.ones_like(x), x, y, z, x * x, x * y, x * z, y * y, y * z, z * z], -1)
    offsets: list[Tensor] = []
    spreads: list[Tensor] = []
    scalars = [torch.linalg.vector_norm(anchors, dim=-1)]
    for sigma in SCALES:
        sums = weight @ moments  # [B, M, 10]
        mean = sums[..., 1:4] / sums[..., :1]
        second = (sums[..., 4:] / sums[..., :1])[..., [0, 1, 2, 1, 3, 4, 2, 4, 5]].unflatten(-1, (3, 3))
        spread = (second - mean[..., :, None] * mean[..., None, :]) / sigma**2
        offsets.append((mean - anchors) / sigma)
        spreads.append(spread)
        trace = spread.diagonal(dim1=-2, dim2=-1).sum(-1)
        flatness = torch.sqrt((spread * spread).sum((-2, -1)) + 1e-8)
        scalars += [torch.log(sums[..., 0] / cloud.shape[1]) / 4, trace, flatness]
        weight.square_().square_()
    turned = [(spread @ anchors[..., None])[..., 0] for spread in spreads]
    leaned = [(spread @ offsets[0][..., None])[..., 0] for spread in spreads]
    vectors = torch.stack([2 * anchors, *offsets, *turned, *leaned], -1)  # [B, M, 3, V]
    return vectors.transpose(1, 2), torch.stack(scalars, -1)
