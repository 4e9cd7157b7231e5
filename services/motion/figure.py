"""The skeleton as torch tensors: forward kinematics from world orientations, and the character's frame on the floor.

Inside the motion service a pose is the hips' position and one *world* orientation matrix per joint, columns = images of
+X, +Y, +Z. Bone lengths are then constant by construction, and forward kinematics is one matrix product:
every joint is the sum of its ancestors' turned offsets.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import torch
from character.skeleton import Skeleton, humanoid_skeleton
from torch import Tensor

CONTACT_JOINTS = ("leftFoot", "leftToes", "rightFoot", "rightToes")
_LEGS = (
    ("leftUpperLeg", "leftLowerLeg", "leftFoot", "leftToes"),
    ("rightUpperLeg", "rightLowerLeg", "rightFoot", "rightToes"),
)


@dataclass(frozen=True, eq=False)
class Figure:
    """What the motion code needs of a skeleton, as tensors."""

    skeleton: Skeleton
    offsets: Tensor  # [J, 3] rest offsets [m]; the root's is zero
    parents: Tensor  # [J] with the root its own parent
    ancestry: Tensor  # [J, J] 1 where the column is the row's ancestor or the row itself
    legs: Tensor  # [2, 4] joints of thigh, shin, foot, toes; left then right
    contacts: Tensor  # [4] joints of CONTACT_JOINTS
    across: Tensor  # [2, 2] (left, right) joints of hips and shoulders, which tell where the figure faces

    @property
    def joint_count(self) -> int:
        """Number of joints J."""
        return self.skeleton.joint_count

    @cached_property
    def lengths(self) -> Tensor:
        """Length of the bone that ends in each joint [J] [m]."""
        return torch.linalg.vector_norm(self.offsets, dim=-1)

    @cached_property
    def _levers(self) -> Tensor:
        """[3 J, J]: what each component of each joint's orientation adds to each joint's place [m]."""
        carries = torch.nn.functional.one_hot(self.parents, self.joint_count).to(self.offsets)  # [J, J]
        return torch.einsum("kp,kb,jk->pbj", carries, self.offsets, self.ancestry).flatten(0, 1)

    @cached_property
    def _spans(self) -> Tensor:
        """[2, J]: times joint positions, from left to right across hips and shoulders."""
        signs = torch.zeros(2, self.joint_count)
        return signs.scatter(1, self.across, torch.tensor([[-1.0, 1.0]]).expand(2, -1))

    def positions(self, hips: Tensor, orientations: Tensor) -> Tensor:
        """Joint positions. Hips [..., 3] [m], world orientations [..., J, 3, 3] -> [..., J, 3] [m]."""
        turned = orientations.transpose(-3, -2).flatten(-2)  # [..., 3, 3 J]
        # One product for every character by itself: a single large one has other last bits for other numbers of them.
        arms = turned @ self._levers.expand(*turned.shape[:-2], -1, -1)
        return (hips[..., None] + arms).transpose(-1, -2).contiguous()

    def facing(self, positions: Tensor) -> Tensor:
        """Unit direction on the floor (x, z) that the torso faces: up x (hips + shoulders across). [..., J, 3] ->
        [..., 2]."""
        floor = positions[..., ::2]  # x and z
        span = unit(self._spans.expand(*floor.shape[:-2], -1, -1) @ floor).sum(-2)
        return unit(torch.stack([span[..., 1], -span[..., 0]], -1))

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
        x, z = self.direction.unbind(-1)
        return torch.stack([z, x, -x, z], -1).unflatten(-1, (2, 2))

    @cached_property
    def _space(self) -> Tensor:
        """[B, 3, 3]: row vectors times this are in the frame."""
        x, z = self.direction.unbind(-1)
        nil = torch.zeros_like(x)
        return torch.stack([z, nil, x, nil, nil + 1, nil, -x, nil, z], -1).unflatten(-1, (3, 3))

    @cached_property
    def place(self) -> Tensor:
        """[B, 1, 3]: the origin on the floor."""
        x, z = self.origin.unbind(-1)
        return torch.stack([x, torch.zeros_like(x), z], -1)[..., None, :]

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
    z = torch.nn.functional.normalize(axes[..., :3], dim=-1, eps=1e-6)
    x = torch.nn.functional.normalize(torch.linalg.cross(axes[..., 3:], z, dim=-1), dim=-1, eps=1e-6)
    return torch.stack([x, torch.linalg.cross(z, x, dim=-1), z], -1)


def turn_between(u: Tensor, v: Tensor) -> Tensor:
    """The smallest rotation that turns direction `u` into `v` (not for opposite ones). [..., 3] -> [..., 3, 3]."""
    u, v = torch.nn.functional.normalize(u, dim=-1), torch.nn.functional.normalize(v, dim=-1)
    axis, cosine = torch.linalg.cross(u, v, dim=-1), (u * v).sum(-1)
    x, y, z = axis.unbind(-1)
    nil = torch.zeros_like(x)
    skew = torch.stack([nil, -z, y, z, nil, -x, -y, x, nil], -1).unflatten(-1, (3, 3))
    return torch.eye(3) + skew + skew @ skew / (1 + cosine).clamp_min(1e-3)[..., None, None]


def figure_of(skeleton: Skeleton) -> Figure:
    """The tensors of one skeleton, which must carry the humanoid bone names. KeyError when one is missing."""
    count = skeleton.joint_count
    ancestry = torch.eye(count)
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            ancestry[joint] += ancestry[parent]
    offsets = torch.tensor(skeleton.rest_offsets, dtype=torch.float32)
    offsets[0] = 0
    across = (("leftUpperLeg", "rightUpperLeg"), ("leftUpperArm", "rightUpperArm"))
    return Figure(
        skeleton=skeleton,
        offsets=offsets,
        parents=torch.tensor([max(p, 0) for p in skeleton.parents]),
        ancestry=ancestry,
        legs=torch.tensor([skeleton.indices(leg) for leg in _LEGS]),
        contacts=torch.tensor(skeleton.indices(CONTACT_JOINTS)),
        across=torch.tensor([skeleton.indices(pair) for pair in across]),
    )


@cache
def humanoid_figure() -> Figure:
    """The figure of the default skeleton."""
    return figure_of(humanoid_skeleton())
