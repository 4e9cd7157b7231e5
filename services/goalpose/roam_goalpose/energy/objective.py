"""The whole objective (paper Eq. 6 and the terms beyond it): the only place where the terms are added up.

The coarse search and the paper's solver want the energy alone, Gauss-Newton also gradient and Gauss-Newton matrix. A
step that does not lower the energy is taken back: of its pose only the energy was needed, a third of the work.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from typing import Any

import torch
from torch import Tensor

from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.reference import ReferenceModel
from roam_goalpose.energy.scene import Scene, Settings, Target
from roam_goalpose.energy.term import Jacobian, Loss, Term, jacobian_concat
from roam_goalpose.energy.terms import TERMS


@dataclass(frozen=True, eq=False)
class Quadratic:
    """The energy around B poses to second order: gradient and Gauss-Newton matrix."""

    gradient: Tensor  # [B, N]
    matrix: Tensor  # [B, N, N]

    def __getitem__(self, index: slice) -> "Quadratic":
        return Quadratic(self.gradient[index], self.matrix[index])


def quadratic_concat(parts: Sequence[Quadratic]) -> Quadratic:
    """Several batches as one."""
    return Quadratic(torch.cat([part.gradient for part in parts]), torch.cat([part.matrix for part in parts]))


def quadratic_where(won: Tensor, new: Quadratic, old: Quadratic) -> Quadratic:
    """The new ones of the poses that `won` [B]."""
    return Quadratic(
        torch.where(won[:, None], new.gradient, old.gradient), torch.where(won[:, None, None], new.matrix, old.matrix)
    )


@dataclass(frozen=True, eq=False)
class Expansion:
    """All terms of the energy of B poses, and their first and second order in the unknowns."""

    scene: Scene
    losses: Mapping[str, Loss]  # of the terms that apply, weighted

    @property
    def figure(self) -> Figure:
        """The poses."""
        return self.scene.figure

    @cached_property
    def terms(self) -> dict[str, Tensor]:
        """Every weighted term by name, [B] each."""
        return {name: loss.energy for name, loss in self.losses.items()}

    @cached_property
    def energy(self) -> Tensor:
        """[B], added term by term: a sum over a tensor's first axis rounds as the size of the batch would have it."""
        return reduce(torch.add, self.terms.values())

    @torch.no_grad()
    def quadratic(self) -> Quadratic:
        """All terms together; only of an expansion in closed form."""
        parts = [
            Jacobian(TERMS[name].jacobian(self.scene), loss.slope, loss.stiffness)
            for name, loss in self.losses.items()
            if self.scene.joints or not TERMS[name].internal
        ]
        motion, slope, stiffness = jacobian_concat(parts)
        gradient = (slope[:, None] @ motion)[:, 0]
        return Quadratic(gradient, motion.transpose(1, 2) @ (stiffness[..., None] * motion))


@dataclass(frozen=True, eq=False)
class Objective:
    """The energy of poses that are compared with `model` on `target`.

    Raises ValueError when no term of `settings.weights` applies, or one is not in the registry.
    """

    model: ReferenceModel
    target: Target
    settings: Settings
    _focus: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def weights(self) -> dict[str, float]:
        """Of the terms that apply, in the registry's order."""
        weights = self.settings.weights
        unknown = [name for name in weights if name not in TERMS]
        if unknown:
            raise ValueError(f"no energy term {', '.join(unknown)}; there are {', '.join(TERMS)}")
        found = {name: weights[name] for name, term in TERMS.items() if weights[name] and term.applies(self.target)}
        if not found:
            raise ValueError(f"all weights are 0; set one of {', '.join(TERMS)}")
        return found

    def at(self, figure: Figure) -> Expansion:
        """The energy of poses, differentiable by autograd."""
        return self._expansion(self._scene(figure))

    @torch.no_grad()
    def expand(self, figure: Figure, *, joints: bool = True) -> Expansion:
        """The energy with what its quadratic is made of; without `joints` in the unknowns of the root alone."""
        return self._expansion(replace(self._scene(figure), joints=joints, closed_form=True))

    def _scene(self, figure: Figure) -> Scene:
        return Scene(figure, self.model, self.target, self.settings, focus=self._focused)

    def _focused(self, name: str) -> Any:
        if name not in self._focus:
            self._focus[name] = TERMS[name].focus(self.model, self.settings)
        return self._focus[name]

    def _expansion(self, scene: Scene) -> Expansion:
        losses = {name: TERMS[name].residual(scene).weighted(weight) for name, weight in self.weights.items()}
        return Expansion(scene, losses)


def coarse_terms(terms: Mapping[str, Term] = TERMS) -> list[str]:
    """Those by which rigid placements are ranked before any descriptor is looked at."""
    return [name for name, term in terms.items() if term.coarse]
