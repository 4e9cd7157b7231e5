"""What the energy knows of reference pairs: for every term what it prepared, a row for each pair."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, Self

import torch
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.body import BodyPoints
from roam_goalpose.energy.figure import Figure, figure_concat
from roam_goalpose.energy.object import DescriptorField, SignedDistance
from roam_goalpose.energy.probes import Probes

PRESS = 0.015  # [m] deepest that a reference person's pressing into the furniture is taken for meant
FAR = 0.4  # [m] beyond this all distances from the object count as equal


@dataclass(frozen=True, eq=False)
class ReferenceScene:
    """One reference pair as `Term.prepare` sees it."""

    figure: Figure  # a batch of one
    body: BodyPoints
    distance: SignedDistance
    floor_height: float
    front: Tensor  # [3] of the object, away from its back; shorter the less front and back differ
    field: DescriptorField
    latent: Any  # of the object
    probes: Probes | None = None  # only for terms that are `probed`

    @property
    def skeleton(self) -> Skeleton:
        """Of the person."""
        return self.figure.skeleton

    @cached_property
    def spheres(self) -> Tensor:
        """The body's spheres [1, P, 3] [m]."""
        return self.body.on(self.figure)

    @cached_property
    def clearances(self) -> Tensor:
        """How far the spheres' centres are from the object, at most `FAR`, and no nearer than pressing by `PRESS`
        brings them [1, P] [m]."""
        return torch.maximum(self.distance.query(self.spheres), self.body.radius - PRESS).clamp(max=FAR)


class Prepared(Protocol):
    """What one term prepared from R reference pairs of one skeleton. Nothing in it carries gradients."""

    @property
    def width(self) -> Hashable:
        """Numbers per reference: problems whose widths differ cannot share their steps."""
        ...

    def __getitem__(self, index: Tensor | slice) -> Self:
        """The same of other references, one for each pose."""
        ...

    def stacked(self, others: Sequence[Self]) -> Self:
        """With those of `others` below."""
        ...


@dataclass(frozen=True, eq=False)
class PerReference:
    """One tensor with a row for every reference."""

    values: Tensor  # [R, ...]

    @property
    def width(self) -> Hashable:
        """Numbers of a row."""
        return tuple(self.values.shape[1:])

    def __getitem__(self, index: Tensor | slice) -> "PerReference":
        return PerReference(self.values[index])

    def stacked(self, others: Sequence["PerReference"]) -> "PerReference":
        """With those of `others` below."""
        return PerReference(torch.cat([self.values, *(other.values for other in others)]))


@dataclass(frozen=True, eq=False)
class LargePerReference:
    """The same for large rows: they are picked only where they are looked at."""

    every: Tensor  # [all, ...] of all references
    row: Tensor  # [R] which of them each is

    @classmethod
    def of(cls, values: Tensor) -> "LargePerReference":
        """From rows [R, ...]."""
        return cls(values, torch.arange(len(values)))

    @property
    def width(self) -> Hashable:
        """Numbers of a row."""
        return tuple(self.every.shape[1:])

    @property
    def values(self) -> Tensor:
        """[R, ...]."""
        return self.every[self.row]

    def __getitem__(self, index: Tensor | slice) -> "LargePerReference":
        return LargePerReference(self.every, self.row[index])

    def stacked(self, others: Sequence["LargePerReference"]) -> "LargePerReference":
        """With those of `others` below, without the rows that nobody picked."""
        return LargePerReference.of(torch.cat([part.values for part in (self, *others)]))


@dataclass(frozen=True, eq=False)
class ReferenceModel:
    """R reference pairs of one skeleton, as poses are compared with them.

    Poses are compared with the one there is (R = 1) or each with its own (R = B, picked with `[which]`).
    """

    skeleton: Skeleton
    body: BodyPoints
    figure: Figure  # the R reference poses
    hip_height: Tensor  # [R] of the hips joint above the surface below it [m]
    floor_height: Tensor  # [R] [m]
    prepared: Mapping[str, Prepared]  # by the term's name

    @property
    def width(self) -> Hashable:
        """Models of other widths cannot share their steps."""
        return self.skeleton.id, tuple((name, part.width) for name, part in self.prepared.items())

    def __len__(self) -> int:
        return len(self.figure)

    def __getitem__(self, index: Tensor | slice) -> "ReferenceModel":
        return replace(
            self,
            figure=self.figure[index],
            hip_height=self.hip_height[index],
            floor_height=self.floor_height[index],
            prepared={name: part[index] for name, part in self.prepared.items()},
        )

    def of(self, which: Tensor) -> "ReferenceModel":
        """What poses made from the references `which` [B] are compared with."""
        return self if len(self) == 1 else self[which]


def models_stack(models: Sequence[ReferenceModel]) -> ReferenceModel:
    """Several references of one skeleton as one model, their rows one below the other."""
    first, *others = models
    if not others:
        return first
    return replace(
        first,
        figure=figure_concat([model.figure for model in models]),
        hip_height=torch.cat([model.hip_height for model in models]),
        floor_height=torch.cat([model.floor_height for model in models]),
        prepared={
            name: part.stacked([other.prepared[name] for other in others]) for name, part in first.prepared.items()
        },
    )
