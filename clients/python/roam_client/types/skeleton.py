"""A skeleton as the server describes it, and where its joints are."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from roam.v1 import skeleton_pb2

from roam_client.connection.packing import Floats, pack_floats, unpack_floats


@dataclass(frozen=True)
class Tip:
    """An end point without rotation: head top, finger tips, toe tips."""

    name: str
    joint: int
    offset: tuple[float, float, float]  # in the joint's frame [m]


@dataclass(frozen=True)
class Capsule:
    """A part of the stand-in body, in the local frame of its joint."""

    joint: int
    start: tuple[float, float, float]  # [m]
    end: tuple[float, float, float]  # [m]
    radius: float  # [m]


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A joint hierarchy in its rest pose; right-handed, Y up, +Z forward, metres."""

    id: str
    joint_names: tuple[str, ...]
    parents: tuple[int, ...]  # -1 for the root; parents first
    rest_offsets: Floats  # [J, 3] from the parent [m]
    rest_rotations: Floats  # [J, 4] xyzw
    humanoid_bones: tuple[str, ...]  # VRM 1.0 name or ""
    tips: tuple[Tip, ...] = ()
    body: tuple[Capsule, ...] = ()

    @classmethod
    def from_message(cls, message: skeleton_pb2.Skeleton, body: tuple[Capsule, ...] = ()) -> Self:
        """Decodes; WireError when the arrays do not fit the joint names."""
        count = len(message.joint_names)
        return cls(
            id=message.id,
            joint_names=tuple(message.joint_names),
            parents=tuple(message.parents),
            rest_offsets=unpack_floats(message.rest_offsets, (count, 3), field="rest_offsets"),
            rest_rotations=unpack_floats(message.rest_rotations, (count, 4), field="rest_rotations"),
            humanoid_bones=tuple(message.humanoid_bones),
            tips=tuple(Tip(t.name, t.joint, (t.offset[0], t.offset[1], t.offset[2])) for t in message.tips),
            body=body,
        )

    @property
    def message(self) -> skeleton_pb2.Skeleton:
        """The protocol's form, without the body."""
        return skeleton_pb2.Skeleton(
            id=self.id,
            joint_names=self.joint_names,
            parents=self.parents,
            rest_offsets=pack_floats(self.rest_offsets),
            rest_rotations=pack_floats(self.rest_rotations),
            humanoid_bones=self.humanoid_bones,
            tips=[skeleton_pb2.Tip(name=tip.name, joint=tip.joint, offset=tip.offset) for tip in self.tips],
        )

    def sized(self, scale: float) -> "Skeleton":
        """The same person `scale` times as large; without a body, which the server makes."""
        offsets = [(scale * tip.offset[0], scale * tip.offset[1], scale * tip.offset[2]) for tip in self.tips]
        tips = tuple(replace(tip, offset=offset) for tip, offset in zip(self.tips, offsets, strict=True))
        return replace(self, id="", rest_offsets=self.rest_offsets * np.float32(scale), tips=tips, body=())

    @property
    def joint_count(self) -> int:
        """Number of joints J."""
        return len(self.joint_names)

    def joint_positions(self, root_positions: Floats, rotations: Floats) -> Floats:
        """World positions [m]. `root_positions` [..., 3], local `rotations` [..., J, 4] -> [..., J, 3]."""
        positions: list[np.ndarray] = []
        orientations: list[np.ndarray] = []
        for joint, parent in enumerate(self.parents):
            if parent < 0:
                positions.append(np.asarray(root_positions))
                orientations.append(rotations[..., joint, :])
                continue
            above = orientations[parent]
            positions.append(positions[parent] + _rotate(above, self.rest_offsets[joint]))
            orientations.append(_multiply(above, rotations[..., joint, :]))
        return np.asarray(np.stack(positions, axis=-2), np.float32)


def capsules_from_messages(messages: list[skeleton_pb2.Capsule]) -> tuple[Capsule, ...]:
    """Decodes the stand-in body."""
    return tuple(
        Capsule(c.joint, (c.start[0], c.start[1], c.start[2]), (c.end[0], c.end[1], c.end[2]), c.radius)
        for c in messages
    )


def _rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Quaternions [..., 4] turn vectors [3] -> [..., 3]."""
    axis, w = q[..., :3], q[..., 3:]
    t = 2.0 * np.cross(axis, v)
    return np.asarray(v + w * t + np.cross(axis, t))


def _multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product [..., 4] x [..., 4] -> [..., 4]."""
    vector = a[..., 3:] * b[..., :3] + b[..., 3:] * a[..., :3] + np.cross(a[..., :3], b[..., :3])
    scalar = a[..., 3:] * b[..., 3:] - np.sum(a[..., :3] * b[..., :3], axis=-1, keepdims=True)
    return np.concatenate([vector, scalar], axis=-1)
