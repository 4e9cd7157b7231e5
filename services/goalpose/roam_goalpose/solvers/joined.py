"""The objects of several requests as one target, for steps that they share.

What a request gets does not depend on what shares its steps, to the bit: every sum runs over one pose's own numbers or
is a matrix product of one object's own queries, whose shape is the same alone and in company.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from roam_goalpose.energy.object import SignedDistance
from roam_goalpose.energy.scene import Target
from roam_goalpose.field.latent import latent_concat


@dataclass(frozen=True, eq=False)
class Distances:
    """The distances of several objects, each for its share of the poses."""

    objects: Sequence[SignedDistance]

    def query(self, points: Tensor) -> Tensor:
        """Points `[B, ..., 3]` [m], as many poses for each object -> `[B, ...]` [m]."""
        return torch.cat([one.query(part) for one, part in self._shares(points)])

    def tangent(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Distance `[B, ...]` [m] and gradient `[B, ..., 3]` at points `[B, ..., 3]` [m]."""
        found = [one.tangent(part) for one, part in self._shares(points)]
        return torch.cat([distance for distance, _ in found]), torch.cat([gradient for _, gradient in found])

    def _shares(self, points: Tensor) -> list[tuple[SignedDistance, Tensor]]:
        return list(zip(self.objects, points.chunk(len(self.objects)), strict=True))


def targets_joined(targets: Sequence[Target], poses: int) -> Target:
    """Several objects, with `poses` poses on each, as one target."""
    if len(targets) == 1:
        return targets[0]
    fronts = torch.stack([target.front for target in targets]).repeat_interleave(poses, dim=0)
    return replace(
        targets[0],
        latent=latent_concat([target.latent for target in targets]),
        distance=Distances([target.distance for target in targets]),
        front=fronts[:, None],
        objects=len(targets),
    )
