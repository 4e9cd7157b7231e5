"""What a character is doing, or is asked to do."""

from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt
from roam.v1 import skeleton_pb2


class Action(IntEnum):
    """The protocol's actions; the numbers are those on the wire and in saved files."""

    UNSPECIFIED = skeleton_pb2.ACTION_UNSPECIFIED
    IDLE = skeleton_pb2.ACTION_IDLE
    WALK = skeleton_pb2.ACTION_WALK
    SIT = skeleton_pb2.ACTION_SIT
    LIE = skeleton_pb2.ACTION_LIE

    @property
    def message(self) -> "skeleton_pb2.Action.ValueType":
        """The protocol's enum value."""
        value: Any = self.value  # enum values are plain ints at run time; the stubs give them a type of their own
        return value


def action_from_message(value: int) -> Action:
    """An action; one that is newer than this client reads as UNSPECIFIED."""
    return Action(value) if value in Action._value2member_map_ else Action.UNSPECIFIED


def action_names() -> npt.NDArray[np.str_]:
    """Lower-case names, indexed by the numbers in saved files."""
    return np.array([action.name.lower() for action in Action])
