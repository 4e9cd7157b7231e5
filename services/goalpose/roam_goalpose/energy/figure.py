"""A batch of candidate poses after forward kinematics: what every energy term looks at."""

from dataclasses import dataclass
from functools import cache, cached_property

import torch
from roam_character.skeleton import Skeleton
from torch import Tensor

from roam_goalpose.energy.turns import matrices, product


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
        return matrices(self.orientations)

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
    """Forward kinematics F(P), paper Eq. 4. `root_position` [B, 3], `rotations` [B, J, 4].

    What `character.kinematics` computes, in a third of the operations: a solver's batches are small, and each costs
    microseconds however little it does.
    """
    tree = _tree(skeleton)
    orientations = [rotations[:, :1]]
    for joints, slots in tree.levels:
        orientations.append(product(orientations[-1].index_select(1, slots), rotations.index_select(1, joints)))
    world = torch.cat(orientations, dim=1).index_select(1, tree.order)
    bones = matrices(world.index_select(1, tree.parents)) @ tree.offsets[..., None]
    away = tree.above.to(bones).expand(len(bones), -1, -1) @ bones[..., 0]
    return Figure(skeleton, root_position, rotations, root_position[:, None] + away, world)


@dataclass(frozen=True, eq=False)
class _Tree:
    """A skeleton's joints as tensors."""

    levels: list[tuple[Tensor, Tensor]]  # joints of every depth below the root, their parents among the depth above
    order: Tensor  # [J] where each joint is when the depths are laid one after the other
    parents: Tensor  # [J], the root's own for the root
    offsets: Tensor  # [J, 3] from the parent [m], none for the root
    above: Tensor  # [J, J] 1 where the column's joint is the row's or above it


@cache
@torch.inference_mode(mode=False)
def _tree(skeleton: Skeleton) -> _Tree:
    levels = [(torch.tensor(level.joints), torch.tensor(level.parent_slots)) for level in skeleton.levels[1:]]
    order = torch.cat([torch.zeros(1, dtype=torch.long), *(joints for joints, _ in levels)]).argsort()
    parents = torch.tensor([0, *skeleton.parents[1:]])
    offsets = torch.tensor(skeleton.rest_offsets, dtype=torch.float32)
    offsets[0] = 0.0
    above = torch.eye(skeleton.joint_count)
    for joint, parent in enumerate(skeleton.parents[1:], start=1):
        above[joint] += above[parent]
    return _Tree(levels, order, parents, offsets, above)


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
