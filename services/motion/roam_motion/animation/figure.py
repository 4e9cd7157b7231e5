"""The skeleton as torch tensors: forward kinematics from world orientations, and the character's frame on the floor.

Inside the motion service a pose is the hips' position and one *world* orientation matrix per joint, columns = images of
+X, +Y, +Z. Bone lengths are then constant by construction, and forward kinematics is one matrix product:
every joint is the sum of its ancestors' turned offsets.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import torch
from roam_character.skeleton import Skeleton, humanoid_skeleton
from torch import Tensor

from roam_motion.animation.elementary import sinc

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
_SKEW = torch.tensor([[0.0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]])
_IDENTITY = torch.eye(3)


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
        return quaternions(self.local(world))


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


def unit(vectors: Tensor) -> Tensor:
    """Vectors scaled to length 1; those shorter than a micrometre stay short. [..., N] -> [..., N]."""
    return vectors / torch.linalg.vector_norm(vectors, dim=-1, keepdim=True).clamp_min(1e-6)


def six(orientations: Tensor) -> Tensor:
    """Forward axis (image of +Z) then up axis (image of +Y). [..., 3, 3] -> [..., 6]."""
    return torch.cat([orientations[..., 2], orientations[..., 1]], -1)


def orthonormal(axes: Tensor) -> Tensor:
    """The rotation matrix nearest in spirit to a forward and an up axis: forward kept, up made square. [..., 6] ->
    [..., 3, 3]."""
    z = unit(axes[..., :3])
    x = unit(torch.linalg.cross(axes[..., 3:], z, dim=-1))
    return torch.stack([x, torch.linalg.cross(z, x, dim=-1), z], -1)


def turn_between(u: Tensor, v: Tensor) -> Tensor:
    """The smallest rotation that turns direction `u` into `v` (not for opposite ones). [..., 3] -> [..., 3, 3]."""
    u, v = unit(u), unit(v)
    skew, cosine = _skew(torch.linalg.cross(u, v, dim=-1)), (u * v).sum(-1)
    return _IDENTITY + skew + skew @ skew / (1 + cosine).clamp_min(1e-3)[..., None, None]


def turn_about(vectors: Tensor) -> Tensor:
    """The rotation about each vector by its length [rad]. [..., 3] -> [..., 3, 3]."""
    angle = torch.linalg.vector_norm(vectors, dim=-1)[..., None, None] / torch.pi  # [half turns]
    whole, half = sinc(torch.stack([angle, angle / 2])).unbind()
    skew = _skew(vectors)
    return _IDENTITY + skew * whole + skew @ skew * (0.5 * half.square())


def quaternions(matrices: Tensor) -> Tensor:
    """Unit quaternions xyzw of rotation matrices. [B, N, 3, 3] -> [B, N, 4].

    `character.rotation.quat_from_matrix` in a sixth of the calls: one product gives all four of Shepperd's formulas.
    """
    formulas = matrices.flatten(-2) @ _formulas().expand(matrices.shape[0], -1, -1)
    best, *others = (formulas.unflatten(-1, (4, 4)) + torch.eye(4)).unbind(-2)
    largest = best[..., :1]
    for i, formula in enumerate(others, start=1):  # each is good where its own component is large
        own = formula[..., i : i + 1]
        best, largest = torch.where(own > largest, formula, best), torch.maximum(own, largest)
    return unit(best)


@cache
def _formulas() -> Tensor:
    """[9, 16]: a matrix's entries times this, and ones on the diagonal, are its quaternion times 4 x, y, z and w."""
    entry = torch.eye(9).view(9, 3, 3)
    trace = entry.diagonal(dim1=-2, dim2=-1).sum(-1)[:, None]
    sums = entry + entry.mT - trace[..., None] * torch.eye(3)
    turn = (entry.mT - entry)[:, [1, 2, 0], [2, 0, 1]]  # of the axis: m21 - m12, m02 - m20, m10 - m01
    return torch.cat([torch.cat([sums, turn[..., None]], 2), torch.cat([turn, trace], 1)[:, None]], 1).flatten(1)


def _skew(vectors: Tensor) -> Tensor:
    """The matrix that crosses with a vector. [..., 3] -> [..., 3, 3]."""
    return (vectors @ _SKEW).unflatten(-1, (3, 3))


def figure_of(skeleton: Skeleton) -> Figure:
    """The tensors of one skeleton, which must carry the humanoid bone names. KeyError when one is missing."""
    count = skeleton.joint_count
    ancestry = torch.eye(count)
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            ancestry[joint] += ancestry[parent]
    offsets = torch.tensor(skeleton.rest_offsets, dtype=torch.float32)
    offsets[0] = 0
    parents = torch.tensor([max(p, 0) for p in skeleton.parents])
    carried = torch.nn.functional.one_hot(parents, count).float()
    return Figure(
        skeleton=skeleton,
        offsets=offsets,
        parents=parents,
        levers=torch.einsum("kp,kb,jk->pbj", carried, offsets, ancestry).flatten(0, 1),
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
