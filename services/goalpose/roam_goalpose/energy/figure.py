"""A batch of candidate poses after forward kinematics: what every energy term looks at."""

from dataclasses import dataclass
from functools import cached_property

import torch
from roam_character.kinematics import forward_kinematics
from roam_character.rotation import quat_to_matrix
from roam_character.skeleton import Skeleton
from torch import Tensor


@dataclass(frozen=True, eq=False)
class Figure:
    """B poses of one skeleton in world space."""

    skeleton: Skeleton
    root_position: Tensor  # [B, 3] [m]
    rotations: Tensor  # [B, J, 4] xyzw, local
    positions: Tensor  # [B, J, 3] world [m]
    orientations: Tensor  # [B, J, 4] xyzw, world

    @cached_property
    def axes(self) -> Tensor:
        """World orientations as matrices [B, J, 3, 3]: the columns are the joints' axes."""
        return quat_to_matrix(self.orientations)

    def attached(self, joints: Tensor, offsets: Tensor) -> Tensor:
        """World positions of points fixed to joints. `joints` [P] or [B, P], `offsets` [..., P, 3] (joint frame).

        -> [B, P, 3] [m].
        """
        return self.of(self.positions, joints) + self.directed(joints, offsets)

    def directed(self, joints: Tensor, vectors: Tensor) -> Tensor:
        """World directions of vectors fixed to joints, as `attached`. -> [B, P, 3]."""
        return (self.of(self.axes, joints) @ vectors[..., None])[..., 0]

    def of(self, values: Tensor, joints: Tensor) -> Tensor:
        """The values [B, J, ...] of joints [P], or of those that each pose names, [B, P]. -> [B, P, ...]."""
        if joints.dim() == 1:
            return values.index_select(1, joints)
        rows = joints + values.shape[1] * torch.arange(len(joints))[:, None]
        return values.flatten(0, 1).index_select(0, rows.flatten()).unflatten(0, rows.shape)

    def moved_to(self, root_position: Tensor) -> "Figure":
        """The same poses elsewhere, [B, 3] [m]."""
        away = (root_position - self.root_position)[:, None]
        return Figure(self.skeleton, root_position, self.rotations, self.positions + away, self.orientations)

    def __len__(self) -> int:
        return self.root_position.shape[0]

    def __getitem__(self, index: Tensor | slice) -> "Figure":
        return Figure(
            self.skeleton,
            self.root_position[index],
            self.rotations[index],
            self.positions[index],
            self.orientations[index],
        )


def figure_from_pose(skeleton: Skeleton, root_position: Tensor, rotations: Tensor) -> Figure:
    """Forward kinematics F(P), paper Eq. 4. `root_position` [B, 3], `rotations` [B, J, 4]."""
    return Figure(skeleton, root_position, rotations, *forward_kinematics(skeleton, root_position, rotations))


def figure_concat(figures: list[Figure]) -> Figure:
    """Several batches of one skeleton as one batch."""
    return Figure(
        figures[0].skeleton,
        torch.cat([f.root_position for f in figures]),
        torch.cat([f.rotations for f in figures]),
        torch.cat([f.positions for f in figures]),
        torch.cat([f.orientations for f in figures]),
    )


def figure_where(won: Tensor, new: Figure, old: Figure) -> Figure:
    """The new poses where they `won` [B]."""
    return Figure(
        old.skeleton,
        torch.where(won[:, None], new.root_position, old.root_position),
        torch.where(won[:, None, None], new.rotations, old.rotations),
        torch.where(won[:, None, None], new.positions, old.positions),
        torch.where(won[:, None, None], new.orientations, old.orientations),
    )
