"""How good a goal pose is."""

from dataclasses import dataclass
from typing import Self

from roam.v1 import goal_pose_pb2


@dataclass(frozen=True)
class BonePenetration:
    """How deep one bone of the stand-in body lies in the object."""

    bone: str  # VRM 1.0
    depth: float  # [m]
    volume: float  # [m^3]


@dataclass(frozen=True)
class PoseQuality:
    """Measured with the stand-in body, capsules on the bones."""

    descriptor_residual: float | None  # difference from the reference's descriptors; None without that term
    penetration_depth: float  # of the deepest capsule [m]
    penetration_volume: float  # [m^3]
    bone_penetrations: tuple[BonePenetration, ...]  # deepest first
    hip_seat_distance: float  # height of the hips over the seat against the reference's [m]
    contacts_met: float  # share of the reference's contacts
    floor_distance: float | None  # of the worse sole [m]; None where the reference's feet hang
    joint_limit_use: float  # of the most bent joint; 1 is the limit

    @classmethod
    def from_message(cls, message: goal_pose_pb2.PoseQuality) -> Self:
        """Decodes."""
        return cls(
            descriptor_residual=message.descriptor_residual if message.HasField("descriptor_residual") else None,
            penetration_depth=message.penetration_depth,
            penetration_volume=message.penetration_volume,
            bone_penetrations=tuple(BonePenetration(b.bone, b.depth, b.volume) for b in message.bone_penetrations),
            hip_seat_distance=message.hip_seat_distance,
            contacts_met=message.contacts_met,
            floor_distance=message.floor_distance if message.HasField("floor_distance") else None,
            joint_limit_use=message.joint_limit_use,
        )
