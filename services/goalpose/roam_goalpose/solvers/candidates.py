"""A batch of candidate poses and how good each is."""

import math
from dataclasses import dataclass

import torch
from roam_character.pose import Pose
from torch import Tensor

from roam_goalpose.energy.figure import Figure, figure_concat, figure_where

TOO_DEEP, SUNK = 0.03, 30.0  # [m], [1/m]: a capsule a centimetre deeper than this counts as much as 0.3 of energy
# Of poses as good as each other, as on a stool or a bench, always the same one, whichever way the upload stands: the
# one that faces the object's own front, and of two beside its middle that on the left. Rounding moves energies
# by 0.003.
AHEAD = 0.02  # that facing to the side costs; facing backwards twice as much
ASIDE = 0.02  # [1/m] that places farther to the right cost


@dataclass(frozen=True, eq=False)
class Candidates:
    """B poses with their energies."""

    figure: Figure
    reference: Tensor  # [B] which reference pair each is made from
    energy: Tensor  # [B]
    terms: dict[str, Tensor]  # weighted, each [B]
    deepest: Tensor | float = 0.0  # [B] depth of the deepest capsule in the object [m], once it is known

    @property
    def fit(self) -> Tensor:
        """What candidates are ranked by [B]: energy, the descriptor at half its weight, and more for what is too deep.

        Descriptor residuals order the placements of one reference better than references: around a bare bench
        descriptors are blander than around an armchair, and smaller residuals say less of a better fit. Thin boards
        hide from the energy how wrong a leg through them is. Ties are broken in the object's own axes, in which all
        poses are solved.
        """
        sunk = torch.as_tensor(self.deepest - TOO_DEEP).clamp(min=0.0)
        fit = self.energy - 0.5 * self.terms.get("descriptor", torch.zeros(())) + SUNK * sunk
        return fit + AHEAD * (1.0 - facing_yaw(self.figure).cos()) - ASIDE * self.figure.root_position[:, 0]

    def __len__(self) -> int:
        return len(self.energy)

    def picked(self, index: Tensor | slice) -> "Candidates":
        """Some of them, in the order of `index`."""
        terms = {name: term[index] for name, term in self.terms.items()}
        deepest = self.deepest[index] if isinstance(self.deepest, Tensor) else self.deepest
        return Candidates(self.figure[index], self.reference[index], self.energy[index], terms, deepest)

    def replaced(self, won: Tensor, better: "Candidates") -> "Candidates":
        """The better ones where they `won` [B]."""
        return Candidates(
            figure_where(won, better.figure, self.figure),
            self.reference,
            torch.where(won, better.energy, self.energy),
            {name: torch.where(won, term, self.terms[name]) for name, term in better.terms.items()},
        )

    def ranked(self) -> "Candidates":
        """Best first."""
        return self.picked(torch.argsort(self.fit, stable=True))

    def pose(self, index: int = 0) -> Pose:
        """One candidate as a pose."""
        root = self.figure.root_position[index].detach().numpy().copy()
        rotations = self.figure.rotations[index].detach()
        return Pose(self.figure.skeleton, root, (rotations / rotations.norm(dim=-1, keepdim=True)).numpy())


def facing_yaw(figure: Figure) -> Tensor:
    """Heading of the pelvis on the floor: where its left side says the front is; also meaningful when lying. -> [B]
    [rad]."""
    legs = figure.skeleton.indices(["leftUpperLeg", "rightUpperLeg"])
    across = figure.positions[:, legs[0]] - figure.positions[:, legs[1]]
    return torch.atan2(-across[:, 2], across[:, 0])


def candidates_concat(parts: list[Candidates]) -> Candidates:
    """Several batches with the same terms as one."""
    return Candidates(
        figure_concat([part.figure for part in parts]),
        torch.cat([part.reference for part in parts]),
        torch.cat([part.energy for part in parts]),
        {name: torch.cat([part.terms[name] for part in parts]) for name in parts[0].terms},
    )


def distinct(
    candidates: Candidates, count: int, *, reach: float = 0.12, angle: float = 0.6, each: int | None = None
) -> Tensor:
    """Indices of the best `count` that differ from every better one of their reference by more than `reach` [m] or
    `angle` [rad] of heading, at most `each` of any reference.

    Looks at the best thirty times `count` only.
    """
    order = torch.argsort(candidates.fit, stable=True)[: 30 * count]
    figure = candidates.figure[order]
    roots, yaws = figure.root_position.tolist(), facing_yaw(figure).tolist()
    kept: dict[int, list[int]] = {}  # of each reference, places in `order`
    chosen: list[int] = []
    for i, reference in enumerate(candidates.reference[order].tolist()):
        mine = kept.setdefault(reference, [])
        alike = any(
            math.dist(roots[i], roots[k]) < reach and abs(math.remainder(yaws[i] - yaws[k], math.tau)) < angle
            for k in mine
        )
        if not alike and (each is None or len(mine) < each):
            mine.append(i)
            chosen.append(i)
            if len(chosen) == count:
                break
    return order[chosen]
