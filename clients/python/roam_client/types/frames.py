"""What a stream carries: its header, frames and events."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Self

import numpy as np
import numpy.typing as npt
from roam.v1 import motion_pb2

from roam_client.connection.packing import Floats, unpack_bits, unpack_floats, unpack_rotations
from roam_client.types.actions import Action, action_from_message
from roam_client.types.skeleton import Skeleton


class EventType(IntEnum):
    """Kinds of events."""

    UNSPECIFIED = motion_pb2.EVENT_TYPE_UNSPECIFIED
    GOAL_REACHED = motion_pb2.EVENT_TYPE_GOAL_REACHED
    FRAMES_SKIPPED = motion_pb2.EVENT_TYPE_FRAMES_SKIPPED
    DRAINING = motion_pb2.EVENT_TYPE_DRAINING
    CONTROL_APPLIED = motion_pb2.EVENT_TYPE_CONTROL_APPLIED
    SESSION_ENDED = motion_pb2.EVENT_TYPE_SESSION_ENDED
    WARNING = motion_pb2.EVENT_TYPE_WARNING


@dataclass(frozen=True)
class Header:
    """What a reader needs before the frames."""

    session: str
    skeleton: Skeleton
    rotation_encoding: int
    frame_rate: float  # [1/s]
    first_sequence: int
    discontinuity: bool  # frames between the last one and first_sequence are lost for good
    contact_joints: tuple[int, ...]  # joint of every column of Frame.contacts
    exact: bool  # after a resume: as if the stream had never broken, bit for bit

    @classmethod
    def from_message(cls, message: motion_pb2.StreamHeader, *, known: Skeleton | None = None) -> Self:
        """Decodes; `known` is the skeleton of an earlier header, used when this one names only its id."""
        bare = not message.skeleton.joint_names
        return cls(
            session=message.session,
            skeleton=known if bare and known is not None else Skeleton.from_message(message.skeleton),
            rotation_encoding=message.rotation_encoding,
            frame_rate=message.frame_rate,
            first_sequence=message.first_sequence,
            discontinuity=message.discontinuity,
            contact_joints=tuple(message.contact_joints),
            exact=message.exact,
        )


@dataclass(frozen=True, eq=False)
class Frame:
    """One instant of the character."""

    sequence: int
    time: float  # [s]
    root_position: Floats  # [3] world [m]
    rotations: Floats  # [J, 4] local, xyzw
    joint_positions: Floats  # [J, 3] world [m]
    contacts: npt.NDArray[np.bool_]  # [4] leftFoot, leftToes, rightFoot, rightToes
    action: Action
    goal_distance: float | None  # mean joint distance to the goal pose [m]

    @classmethod
    def from_message(cls, message: motion_pb2.Frame, header: Header) -> Self:
        """Decodes; WireError when the bytes do not fit the header."""
        skeleton = header.skeleton
        root = unpack_floats(message.root, (7,), field="root")[:3]
        rotations = unpack_rotations(message.rotations, skeleton.joint_count, header.rotation_encoding)
        packed = message.joint_positions
        return cls(
            sequence=message.sequence,
            time=message.time,
            root_position=root,
            rotations=rotations,
            joint_positions=unpack_floats(packed, (skeleton.joint_count, 3), field="joint_positions")
            if packed
            else skeleton.joint_positions(root, rotations),
            contacts=unpack_bits(message.contacts, len(header.contact_joints)),
            action=action_from_message(message.action),
            goal_distance=message.goal_distance if message.HasField("goal_distance") else None,
        )


@dataclass(frozen=True)
class Event:
    """Something that happened to the session."""

    type: EventType
    sequence: int
    message: str = ""
    control_id: int = 0
    goal_pose: str = ""
    skipped_count: int = 0
    reason: str = ""  # WARNING: SPEED_CUT, SEAT_TAKEN, START_IN_FURNITURE

    @classmethod
    def from_message(cls, message: motion_pb2.SessionEvent) -> Self:
        """Decodes; a type that is newer than this client reads as UNSPECIFIED."""
        known = message.type in EventType._value2member_map_
        return cls(
            type=EventType(message.type) if known else EventType.UNSPECIFIED,
            sequence=message.sequence,
            message=message.message,
            control_id=message.control_id,
            goal_pose=message.goal_pose,
            skipped_count=message.skipped_count,
            reason=message.reason,
        )
