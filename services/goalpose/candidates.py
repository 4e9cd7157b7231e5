"""A batch of candidate poses and how good each is."""

from dataclasses import dataclass

import torch
from character.pose import Pose
from torch import Tensor

from goalpose.energy.figure import Figure


@dataclass(frozen=True, eq=False)
class Candidates:
    """B poses with their energies."""

    figure: Figure
    energy: Tensor  # [B]
    terms: dict[str, Tensor]  # weighted, each [B]

    def __len__(self) -> int:
        return len(self.energy)

    def picked(self, index: Tensor) -> "Candidates":
        """Some of them, in the order of `index`."""
        return Candidates(
            self.figure[index], self.energy[index], {name: term[index] for name, term in self.terms.items()}
        )

    def ranked(self) -> "Candidates":
        """Best first."""
        return self.picked(torch.argsort(self.energy, stable=True))

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


def distinct(candidates: Candidates, count: int, *, reach: float = 0.12, angle: float = 0.6) -> Tensor:
    """Indices of the best `count` that differ from every better one by more than `reach` [m] or `angle` [rad] of
    heading.

    Looks at the best thirty times `count` only.
    """
    order = torch.argsort(candidates.energy, stable=True)[: 30 * count]
    root, yaw = candidates.figure.root_position[order], facing_yaw(candidates.figure[order])
    turn = yaw[:, None] - yaw[None]
    near = torch.linalg.vector_norm(root[:, None] - root[None], dim=-1) < reach
    same = (near & (torch.atan2(turn.sin(), turn.cos()).abs() < angle)).numpy()
    kept: list[int] = []
    for i in range(len(order)):
        if not same[i, kept].any():
            kept.append(i)
            if len(kept) == count:
                break
    return order[kept]
