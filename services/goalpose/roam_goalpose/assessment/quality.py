"""How good a pose is, for callers: what the solver measured, and how much of which bone lies in the object."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from roam_character.body import Capsules, body_capsules
from roam_character.pose import Pose
from roam_character.rotation import quat_between, quat_rotate

from roam_goalpose.assessment.result import RankedPose
from roam_goalpose.energy.terms.angle_limit import load_limits, swing_twist
from roam_goalpose.objects import Shape

Array = NDArray[np.floating]

POINTS = 400  # in every capsule, to measure the volume with


@dataclass(frozen=True)
class BonePenetration:
    """How deep one bone's capsule lies in the object."""

    bone: str
    depth: float  # [m]
    volume: float  # [m^3]


@dataclass(frozen=True)
class PoseQuality:
    """The measures of `PoseQuality` in the protocol."""

    descriptor_residual: float | None  # None: the term was switched off
    penetrations: tuple[BonePenetration, ...]  # deepest first
    hip_seat_distance: float  # [m]
    contacts_met: float
    floor_distance: float | None  # [m]
    joint_limit_use: float  # 1: at the limit

    @property
    def penetration_depth(self) -> float:
        """Of the deepest capsule [m]."""
        return max((bone.depth for bone in self.penetrations), default=0.0)

    @property
    def penetration_volume(self) -> float:
        """Of all capsules [m^3]; where they overlap it counts twice."""
        return sum(bone.volume for bone in self.penetrations)


def quality_of(ranked: RankedPose, shape: Shape, *, descriptor_weight: float) -> PoseQuality:
    """The quality of one of the poses on the object `shape`; `descriptor_weight` is what the energy's term weighed."""
    values, descriptor = ranked.diagnostics, ranked.energies.get("descriptor")
    return PoseQuality(
        descriptor_residual=None if descriptor is None else descriptor / descriptor_weight,
        penetrations=bone_penetrations(ranked.pose, ranked.bone_depths, shape),
        hip_seat_distance=values["hip_seat_distance"],
        contacts_met=values["contacts_met"],
        floor_distance=values.get("floor_distance"),
        joint_limit_use=joint_limit_use(ranked.pose),
    )


def bone_penetrations(pose: Pose, depths: Mapping[str, float], shape: Shape) -> tuple[BonePenetration, ...]:
    """Depths [m] of bones with the volumes that belong to them, deepest first."""
    capsules = body_capsules(pose.skeleton)
    rows = sorted(((depths[n], c, n) for c, n in enumerate(capsules.names) if depths.get(n, 0.0) > 0), reverse=True)
    volumes = _volumes_inside(capsules, [c for _, c, _ in rows], pose, shape)
    return tuple(BonePenetration(name, depth, volume) for (depth, _, name), volume in zip(rows, volumes, strict=True))


def _volumes_inside(capsules: Capsules, chosen: list[int], pose: Pose, shape: Shape) -> list[float]:
    """How much of each of the `chosen` capsules is in the object [m^3], from points spread evenly in it."""
    if not chosen:
        return []
    starts, ends = capsules.segments(*pose.posture())
    axes = np.asarray(ends - starts, np.float64)
    lengths, radii = np.linalg.norm(axes, axis=-1), np.asarray(capsules.radii, np.float64)
    clouds = [_points_in_capsule(float(lengths[c]), float(radii[c])) for c in chosen]
    placed = [starts[c] + _along(axes[c], cloud) for c, cloud in zip(chosen, clouds, strict=True)]
    inside = shape.distance.sample(np.concatenate(placed)) < 0
    shares = [float(part.mean()) for part in np.split(inside, np.cumsum([len(cloud) for cloud in clouds])[:-1])]
    volumes = np.pi * radii**2 * (lengths + 4 / 3 * radii)
    return [share * float(volumes[c]) for c, share in zip(chosen, shares, strict=True)]


def _along(axis: Array, points: Array) -> Array:
    """Points [N, 3] around +Y as points around `axis` [3]."""
    length = float(np.linalg.norm(axis))
    if length == 0:
        return points
    turn = quat_between(np.array([0.0, 1.0, 0.0]), axis / length)
    turned: Array = quat_rotate(np.broadcast_to(turn, (len(points), 4)), points)
    return turned


def _points_in_capsule(length: float, radius: float) -> Array:
    """Points [N, 3] in a capsule that stands on the origin along +Y; the same every time."""
    random = np.random.default_rng(0)
    points = random.uniform([-radius, -radius, -radius], [radius, length + radius, radius], (POINTS, 3))
    nearest = np.clip(points[:, 1], 0.0, length)
    off_axis = points - nearest[:, None] * np.array([0.0, 1.0, 0.0])
    return points[np.linalg.norm(off_axis, axis=-1) <= radius]


def joint_limit_use(pose: Pose) -> float:
    """How far the most bent joint has gone from the middle of its range towards its limit; 1 is the limit."""
    limits = load_limits(pose.skeleton)
    angles = swing_twist(torch.as_tensor(pose.rotations)[limits.joint], limits.axis)
    middle, half = (limits.high + limits.low) / 2, (limits.high - limits.low) / 2
    return float(((angles - middle).abs() / half).max())
