"""The skeleton as torch tensors: forward kinematics from world orientations, and the character's frame on the floor.

Inside the motion service a pose is the hips' position and one *world* orientation matrix per joint, columns = images of
+X, +Y, +Z. Bone lengths are then constant by construction, and forward kinematics is one matrix product:
every joint is the sum of its ancestors' turned offsets.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import torch
from roam_character.matrices import unit
from roam_character.rotation import quat_from_matrix
from roam_character.skeleton import Skeleton, humanoid_skeleton
from torch import Tensor

CONTACT_JOINTS = ("leftFoot", "leftToes", "rightFoot", "rightToes")
_LEGS = (
    ("leftUpperLeg", "leftLowerLeg", "leftFoot", "leftToes"),
    ("rightUpperLeg", "rightLowerLeg", "rightFoot", "rightToes"),
)
_ACROSS = ("leftUpperLeg", "rightUpperLeg"), ("leftUpperArm", "rightUpperArm")

# Matrices that put the components of a vector, or their negatives, where they belong: one call instead of one for every
# entry, exact because every entry is one component.
_FLOOR = torch.tensor([[0.0, 1.0, -1.0, 0.0], [1.0, 0.0, 0.0, 1.0]])
_SPACE = torch.tensor([[0.0, 0, 1, 0, 0, 0, -1, 0, 0], [1.0, 0, 0, 0, 0, 0, 0, 0, 1]])
_UPRIGHT = torch.tensor([0.0, 0, 0, 0, 1, 0, 0, 0, 0])
_LEVEL = torch.tensor([[1.0, 0, 0], [0, 0, 1]])
_ASIDE = torch.tensor([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Figure:
    """What the motion code needs of a skeleton, as tensors."""

    skeleton: Skeleton
    offsets: Tensor  # [J, 3] rest offsets [m]; the root's is zero
    parents: Tensor  # [J] with the root its own parent
    levers: Tensor  # [3 J, J] what each column of each joint's orientation adds to each joint's place [m]
    legs: Tensor  # [2, 4] joints of thigh, shin, foot, toes; left then right
    contacts: Tensor  # [4] joints of CONTACT_JOINTS
    across: Tensor  # [2, J] times joint positions: from left to right at hips and shoulders, where the figure faces

    @property
    def joint_count(self) -> int:
        """Number of joints J."""
        return self.skeleton.joint_count

    @cached_property
    def lengths(self) -> Tensor:
        """Length of the bone that ends in each joint [J] [m]."""
        return torch.linalg.vector_norm(self.offsets, dim=-1)

    def positions(self, hips: Tensor, orientations: Tensor) -> Tensor:
        """Joint positions. Hips [..., 3] [m], world orientations [..., J, 3, 3] -> [..., J, 3] [m]."""
        turned = orientations.transpose(-3, -2).flatten(-2)  # [..., 3, 3 J]
        # One product for every character by itself: a single large one has other last bits for other numbers of them.
        arms = turned @ self.levers.expand(*turned.shape[:-2], -1, -1)
        return (hips[..., None] + arms).transpose(-1, -2).contiguous()

    def facing(self, positions: Tensor) -> Tensor:
        """Unit direction on the floor (x, z) that the torso faces: up x (hips + shoulders across). [..., J, 3] ->
        [..., 2]."""
        floor = positions[..., ::2]  # x and z
        span = unit(self.across.expand(*floor.shape[:-2], -1, -1) @ floor).sum(-2)
        return unit(span @ _ASIDE)

    def frame(self, positions: Tensor) -> "Frame":
        """The root frame: hips projected to the floor, with the torso's facing. [..., J, 3] -> Frame [...]."""
        return Frame(positions[..., 0, ::2], self.facing(positions))

    def world(self, local: Tensor) -> Tensor:
        """Local to world orientations. [..., J, 3, 3] -> [..., J, 3, 3]."""
        world = [local[..., 0, :, :]]
        for joint, parent in enumerate(self.skeleton.parents[1:], start=1):
            world.append(world[parent] @ local[..., joint, :, :])
        return torch.stack(world, -3)

    def local(self, world: Tensor) -> Tensor:
        """World to local orientations; the root's stays in the world. [..., J, 3, 3] -> [..., J, 3, 3]."""
        local = world[..., self.parents, :, :].transpose(-1, -2) @ world
        return torch.cat([world[..., :1, :, :], local[..., 1:, :, :]], -3)

    def rotations(self, world: Tensor) -> Tensor:
        """World orientations to local unit quaternions xyzw. [B, J, 3, 3] -> [B, J, 4]."""
        return quat_from_matrix(self.local(world))


@dataclass(frozen=True, eq=False)
class Frame:
    """An upright frame on the floor: origin (x, z) [m] and the unit direction (x, z) of its +Z axis.

    Batched over one leading axis; vectors are [B, *, 3] or floor vectors (x, z) [B, *, 2]. One small matrix product
    each: a frame of motion takes some ten of these, and a single character's time goes into calls, not into numbers.
    """

    origin: Tensor  # [B, 2]
    direction: Tensor  # [B, 2]

    @cached_property
    def _floor(self) -> Tensor:
        """[B, 2, 2]: row vectors (x, z) times this are in the frame."""
        return (self.direction @ _FLOOR).unflatten(-1, (2, 2))

    @cached_property
    def _space(self) -> Tensor:
        """[B, 3, 3]: row vectors times this are in the frame."""
        return torch.addmm(_UPRIGHT, self.direction, _SPACE).unflatten(-1, (3, 3))

    @cached_property
    def place(self) -> Tensor:
        """[B, 1, 3]: the origin on the floor."""
        return (self.origin @ _LEVEL)[..., None, :]

    def turn_in(self, vectors: Tensor) -> Tensor:
        """World directions into this frame."""
        return vectors @ (self._floor if vectors.shape[-1] == 2 else self._space)

    def turn_out(self, vectors: Tensor) -> Tensor:
        """Directions of this frame into the world, the inverse of `turn_in`."""
        return vectors @ (self._floor if vectors.shape[-1] == 2 else self._space).transpose(-1, -2)

    def points_in(self, points: Tensor) -> Tensor:
        """World points into this frame."""
        origin = self.origin[..., None, :] if points.shape[-1] == 2 else self.place
        return self.turn_in(points - origin)

    def points_out(self, points: Tensor) -> Tensor:
        """Points of this frame into the world."""
        origin = self.origin[..., None, :] if points.shape[-1] == 2 else self.place
        return self.turn_out(points) + origin


def figure_of(skeleton: Skeleton) -> Figure:
    """The tensors of one skeleton, which must carry the humanoid bone names. KeyError when one is missing."""
    offsets = torch.tensor(skeleton.bone_offsets, dtype=torch.float32)
    parents = torch.tensor(skeleton.upper_joints)
    carried = torch.nn.functional.one_hot(parents, skeleton.joint_count).float()
    return Figure(
        skeleton=skeleton,
        offsets=offsets,
        parents=parents,
        levers=torch.einsum("kp,kb,jk->pbj", carried, offsets, torch.tensor(skeleton.ancestors)).flatten(0, 1),
        legs=torch.tensor([skeleton.indices(leg) for leg in _LEGS]),
        contacts=torch.tensor(skeleton.indices(CONTACT_JOINTS)),
        across=_across(skeleton),
    )


def _across(skeleton: Skeleton) -> Tensor:
    pairs = torch.zeros(len(_ACROSS), skeleton.joint_count)
    for row, (left, right) in zip(pairs, _ACROSS, strict=True):
        row[skeleton.index(left)], row[skeleton.index(right)] = -1, 1
    return pairs


@cache
def humanoid_figure() -> Figure:
    """The figure of the default skeleton."""
    return figure_of(humanoid_skeleton())
