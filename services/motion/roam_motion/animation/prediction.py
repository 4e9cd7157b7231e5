"""What a motion model is asked for a frame, and what it answers.

Goals are 13 root goals (place, direction) with one action, as the controller sets the action hard for all keys: the
paper has an action for each key.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from roam_character.matrices import matrix_from_6d
from torch import Tensor

from roam_motion.actions import STYLES
from roam_motion.animation.figure import Figure, Frame
from roam_motion.animation.rows import split_tensor
from roam_motion.animation.state import KEYS, Characters


@dataclass
class Goals:
    """Where B characters are to go, in the world."""

    positions: Tensor  # [B, 13, 2] root goals 0..2 s ahead, or the goal pose's root when sitting or lying
    directions: Tensor  # [B, 13, 2]
    action: Tensor  # [B, 4] one-hot idle, walk, sit, lie
    active: Tensor  # [B] 1 while the goal pose counts (sit, lie): the paper's delta
    pose_positions: Tensor  # [B, J, 3] goal pose
    pose_orientations: Tensor  # [B, J, 3, 3]
    feet: Tensor  # [B, 2, 4] where both ankles belong (x, z) and where their feet point; directions 0: under the body
    urgency: Tensor  # [B] 0..1: how much a late arrival is drawn to the goal pose (see blending); 0 in training

    @staticmethod
    def of(rows: Tensor, joints: int) -> "Goals":
        """A batch from the numbers of every character's goals [B, G]."""
        return Goals(**split_tensor(rows, goal_shapes(joints)))


def goal_shapes(joints: int) -> dict[str, tuple[int, ...]]:
    """The shapes of a single character's goals."""
    return {
        "positions": (KEYS, 2),
        "directions": (KEYS, 2),
        "action": (len(STYLES),),
        "active": (),
        "pose_positions": (joints, 3),
        "pose_orientations": (joints, 3, 3),
        "feet": (2, 4),
        "urgency": (),
    }


@dataclass(frozen=True)
class Prediction:
    """One prediction in raw units; poses in frames as noted."""

    positions: Tensor  # [B, J, 3] next joints in the current root frame [m]
    axes: Tensor  # [B, J, 6] next forward and up axes in the current root frame
    inverse_positions: Tensor  # [B, J, 3] next joints relative to the goal joints, in the goal's facing [m]
    inverse_axes: Tensor  # [B, J, 6] next axes relative to each goal joint's own orientation
    trajectory: Tensor  # [B, 7, 8] root x, z, direction x, z, styles at t+1 + k/6 s
    inverse_trajectory: Tensor  # [B, 7, 4] root x, z, direction x, z in the goal root's frame
    contacts: Tensor  # [B, 4]
    phase: Tensor  # [B, 7] phase advance from now [turns]


# A motion model on B characters: their goals, joint positions [B, J, 3] and root frames -> what comes next. Graphs are
# traced through it, so it may not look at numbers.
Predict = Callable[[Characters, Goals, Tensor, Frame], Prediction]


def goal_frame(figure: Figure, goals: Goals) -> Frame:
    """The frame of inverse outputs: the goal pose's root when active, else the root goal 1 s ahead."""
    pose = figure.frame(goals.pose_positions)
    active = goals.active[:, None] > 0.5
    now = KEYS // 2
    return Frame(
        torch.where(active, pose.origin, goals.positions[:, now]),
        torch.where(active, pose.direction, goals.directions[:, now]),
    )


def world_axes(root: Frame, axes: Tensor) -> Tensor:
    """Axes of the root frame [B, J, 6] -> world axes [B, J, 6]."""
    return torch.cat([root.turn_out(axes[..., :3]), root.turn_out(axes[..., 3:])], -1)


def goal_orientations(goals: Goals, inverse_axes: Tensor) -> Tensor:
    """Inverse axes [B, J, 6] -> world orientations [B, J, 3, 3]."""
    return goals.pose_orientations @ matrix_from_6d(inverse_axes)
