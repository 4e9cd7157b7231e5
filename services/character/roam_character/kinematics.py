"""Forward kinematics F(P) of the paper's eq. 4, and the two-bone inverse that moves legs and arms.

Batched over leading axes, numpy or torch, differentiable in torch.
"""

from typing import Any, NamedTuple

from roam_character.arrays import Array, indices, like, namespace
from roam_character.rotation import (
    quat_between,
    quat_from_rotvec,
    quat_inv,
    quat_mul,
    quat_rotate,
    quat_to_matrix,
    vec_cross,
    vec_normalize,
)
from roam_character.skeleton import Skeleton


class Posture(NamedTuple):
    """World placement of every joint."""

    positions: Any  # [..., J, 3] [m]
    orientations: Any  # [..., J, 4] xyzw


def forward_kinematics(skeleton: Skeleton, root_position: Array, rotations: Array) -> Posture:
    """Joint positions and orientations in the world.

    `root_position` [..., 3] [m], `rotations` [..., J, 4] local, relative to the parent's frame (the rest rotations
    are identity in every shipped skeleton; where they are not, `rotations` include them).
    """
    xp = namespace(root_position, rotations)
    orientations = [rotations[..., :1, :]]
    for level in skeleton.levels[1:]:
        parents = xp.take(orientations[-1], indices(level.parent_slots, rotations), axis=-2)
        orientations.append(quat_mul(parents, xp.take(rotations, indices(level.joints, rotations), axis=-2)))
    world = xp.take(xp.concat(orientations, axis=-2), indices(skeleton.level_places, rotations), axis=-2)
    # Every joint is the sum of its ancestors' turned offsets: one matrix product instead of a sum per depth.
    offsets = like(skeleton.bone_offsets, rotations)[..., None]
    bones: Any = quat_to_matrix(xp.take(world, indices(skeleton.upper_joints, rotations), axis=-2)) @ offsets
    ancestors: Any = like(skeleton.ancestors, rotations)
    # Broadcast, so that the product of one posture has the same bits in every batch.
    away = xp.broadcast_to(ancestors, (*bones.shape[:-3], *ancestors.shape)) @ bones[..., 0]
    return Posture(root_position[..., None, :] + away, world)


def local_rotations(skeleton: Skeleton, orientations: Array) -> Array:
    """The inverse of the orientation half: world orientations [..., J, 4] -> local rotations [..., J, 4]."""
    xp = namespace(orientations)
    parents = list(skeleton.parents[1:])
    children = quat_mul(quat_inv(orientations[..., parents, :]), orientations[..., 1:, :])
    return xp.concat([orientations[..., :1, :], children], axis=-2)


def tip_positions(skeleton: Skeleton, positions: Array, orientations: Array) -> Array:
    """World positions of the skeleton's tips, [..., T, 3] [m]."""
    parents = [tip.parent for tip in skeleton.tips]
    offsets = like([tip.offset for tip in skeleton.tips], positions)
    return positions[..., parents, :] + quat_rotate(orientations[..., parents, :], offsets)


def facing(skeleton: Skeleton, positions: Array) -> Array:
    """Yaw [rad] that a figure faces: up x (right-to-left hip + right-to-left shoulder), on the floor.

    `positions` [..., J, 3] -> [...].
    """
    xp = namespace(positions)
    left = skeleton.indices(["leftUpperLeg", "leftUpperArm"])
    right = skeleton.indices(["rightUpperLeg", "rightUpperArm"])
    across = positions[..., left, :] - positions[..., right, :]  # [..., 2, 3]
    across = across * like([1.0, 0.0, 1.0], positions)
    across = xp.sum(vec_normalize(across), axis=-2)
    return xp.atan2(-across[..., 2], across[..., 0])


class Limb(NamedTuple):
    """Two bones and the joint at their end: hip-knee-ankle or shoulder-elbow-wrist."""

    upper: int
    lower: int
    end: int


def limb(skeleton: Skeleton, name: str) -> Limb:
    """`leftLeg`, `rightLeg`, `leftArm` or `rightArm` by humanoid bones."""
    side = "left" if name.startswith("left") else "right"
    bones = ("UpperLeg", "LowerLeg", "Foot") if name.endswith("Leg") else ("UpperArm", "LowerArm", "Hand")
    return Limb(*skeleton.indices([side + bone for bone in bones]))


def two_bone_ik(
    start: Array, middle: Array, end: Array, target: Array, *, bend: Array | None = None
) -> tuple[Array, Array]:
    """World turns that bring the end of a two-bone limb to a target.

    Args: world positions [..., 3] of the limb's joints now and of the target [m]; `bend` [..., 3], the side towards
    which the middle joint points when the limb is straight (default: +Z, a knee).
    Returns: quaternions (upper, lower) [..., 4] to multiply on the left of the two bones' world orientations; the lower
    one already contains the upper one. A target out of reach is approached as far as the bones go.
    """
    xp = namespace(start, target)
    a, b = middle - start, end - middle
    la, lb = _norm(a), _norm(b)
    reach = _norm(target - start)
    reach = xp.minimum(xp.maximum(reach, xp.abs(la - lb) + 1e-4), (la + lb) * 0.9999)
    wanted = xp.acos(_cosine(la, lb, reach))
    now = xp.acos(_cosine(la, lb, xp.minimum(_norm(end - start), (la + lb) * 0.9999)))
    # The bones' own plane, eased into the plane of `bend` where they are nearly in line: the knee cannot flip over.
    forward = like([0.0, 0.0, 1.0], start) if bend is None else bend
    forward = xp.broadcast_to(forward, a.shape)
    sideways = vec_cross(vec_normalize(forward), vec_normalize(end - start))
    axis = vec_normalize(vec_cross(a, b) / (la * lb) + 0.02 * sideways)
    turn = quat_from_rotvec(axis * (now - wanted))
    bent = middle + quat_rotate(turn, b)
    swing = quat_between(bent - start, target - start)
    return swing, quat_mul(swing, turn)


def bent_joint(
    start: Array, end: Array, lengths: tuple[Array, Array], side: Array, *, straightest: float = 0.9999
) -> Array:
    """Where the middle joint of a two-bone limb is: the knee of a leg, the elbow of an arm.

    Args: world positions [..., 3] of the limb's first joint and of where its end goes [m]; the bones' lengths, each
    [..., 1] [m]; `side` [..., 3], any direction towards which the joint points.
    An end nearer than the bones can fold or farther than `straightest` of their sum is taken as that far.
    Returns: [..., 3] [m].
    """
    xp = namespace(start, end)
    upper, lower = lengths
    way = end - start
    reach = _norm(way)
    way = way / reach
    reach = xp.minimum(xp.maximum(reach, xp.abs(upper - lower) + 1e-4), (upper + lower) * straightest)
    cosine = _cosine(upper, reach, lower)
    across = vec_normalize(side - xp.sum(side * way, axis=-1, keepdims=True) * way)
    return start + upper * (cosine * way + xp.sqrt(xp.maximum(1 - cosine * cosine, 0 * cosine)) * across)


def _norm(v: Array) -> Array:
    xp = namespace(v)
    return xp.sqrt(xp.sum(v * v, axis=-1, keepdims=True) + 1e-12)


def _cosine(a: Array, b: Array, opposite: Array) -> Array:
    """Of the angle between two sides of a triangle (law of cosines); within ±1, where acos has a slope."""
    xp = namespace(a)
    cosine = (a * a + b * b - opposite * opposite) / (2 * a * b)
    return xp.minimum(xp.maximum(cosine, -1 + 1e-7 + 0 * cosine), 1 - 1e-7 + 0 * cosine)


def reach_with_limb(
    skeleton: Skeleton,
    which: Limb,
    posture: Posture,
    target: Array,
    *,
    bend: Array | None = None,
    keep_end: bool = True,
) -> Array:
    """Local rotations of upper, lower and end joint [..., 3, 4] that bring the limb's end to `target` [..., 3].

    `keep_end` holds the world orientation of the foot or hand.
    """
    xp = namespace(target)
    positions, orientations = posture
    points = (positions[..., which.upper, :], positions[..., which.lower, :], positions[..., which.end, :])
    upper, lower = two_bone_ik(*points, target, bend=bend)
    parent = orientations[..., skeleton.parents[which.upper], :]
    new_upper = quat_mul(upper, orientations[..., which.upper, :])
    new_lower = quat_mul(lower, orientations[..., which.lower, :])
    end = orientations[..., which.end, :]
    new_end = end if keep_end else quat_mul(lower, end)
    return xp.stack(
        [
            quat_mul(quat_inv(parent), new_upper),
            quat_mul(quat_inv(new_upper), new_lower),
            quat_mul(quat_inv(new_lower), new_end),
        ],
        axis=-2,
    )
