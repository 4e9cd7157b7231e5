"""What an l-NSM is: its sizes, and which parts of the method (paper 3.2) it has. Written into its weights file.

Ablations are configurations without a part: its numbers are always 0. What the network is shown is masked before it is
normalised, and what it answers is masked before it is used, in roll-outs, examples and evaluations alike. An encoder
that is missing leaves its inputs to the experts as they are.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import Tensor

from roam_motion.actions import STYLES
from roam_motion.animation.blending import Blending
from roam_motion.animation.state import KEYS
from roam_motion.models.lnsm.features import (
    Inputs,
    columns,
    frame_widths,
    gating_widths,
    goal_widths,
    output_widths,
)


@dataclass(frozen=True)
class Parts:
    """What a network has of the method."""

    frame_encoder: bool = True
    goal_encoder: bool = True
    goal_pose: bool = True  # the goal encoder sees the goal pose: the paper's delta may be 1
    trajectory: bool = True  # the frame encoder sees the root's way of +-1 s and its styles
    gate_phase: bool = True  # the gate sees the gait phase
    gate_action: bool = True  # the gate sees styles, actions, and the goal's distance and angle
    inverse: bool = True  # the goal-centric answer is learned and blended in
    contacts: bool = True  # contacts are learned, and feet locked by them

    def blending(self, *, settling: bool = True) -> Blending:
        """How answers are blended."""
        return Blending(inverse=self.inverse, settling=settling and self.inverse)

    def seen(self, inputs: Inputs) -> Inputs:
        """Raw inputs without what is missing."""
        frame, goal, gating = inputs.frame, inputs.goal, inputs.gating
        joints = _joints(frame.shape[1])
        if not self.goal_pose:
            goal = goal * ~columns(goal_widths(joints), "pose")
        if not (self.gate_phase and self.gate_action):
            gating = self._gating(inputs)
        if not self.trajectory:
            frame = frame * ~columns(frame_widths(joints), "places", "directions", "styles")
        return Inputs(frame, goal, gating)

    def _gating(self, inputs: Inputs) -> Tensor:
        """The gate's inputs [B, S], which are products of labels and phase, with one of the two or neither."""
        out, joints = torch.zeros_like(inputs.gating), _joints(inputs.frame.shape[1])
        if self.gate_phase:
            # Of labels that add up to one the signs 2 x - 1 add up to 2 minus their number.
            signs = inputs.gating[:, columns(gating_widths(), "styles")].reshape(-1, KEYS, len(STYLES), 2)
            out[:, : 2 * KEYS] = signs.sum(2).flatten(1) / (2 - len(STYLES))
        elif self.gate_action:
            styles = inputs.frame[:, columns(frame_widths(joints), "styles")]
            shown = torch.cat([styles, inputs.goal[:, ~columns(goal_widths(joints), "pose")]], 1)
            out[:, : shown.shape[1]] = shown
        return out

    def answered(self, joints: int, output: Tensor) -> Tensor:
        """A raw output [B, O] without what is missing."""
        return output if self.contacts else output * ~columns(output_widths(joints), "contacts")

    def missing(self, joints: int) -> Tensor:
        """Output columns [O] that are not learned."""
        names = [] if self.inverse else ["inverse_positions", "inverse_axes"]
        return columns(output_widths(joints), *names, *([] if self.contacts else ["contacts"]))


WHOLE = Parts()


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes and parts.

    The paper has 10 experts of width 512 (13.7 M parameters); the defaults of training are what two CPU cores train in
    an hour and a half.
    """

    frame: int  # numbers that describe the character
    goal: int  # numbers that describe the goal
    gating: int  # phase x labels x distance and angle
    output: int
    experts: int = 8
    encoding: int = 256
    hidden: int = 256
    gate_hidden: int = 64
    dropout: float = 0.0  # on the encoders' inputs; the paper's 0.3 costs accuracy when targets are per-frame changes
    parts: Parts = WHOLE

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for the weights file; `parts` only where something is missing."""
        fields = asdict(self)
        fields["parts"] = {name: False for name, there in fields["parts"].items() if not there}
        return {name: value for name, value in fields.items() if name != "parts" or value}

    @staticmethod
    def from_dict(fields: Mapping[str, Any]) -> "NetworkConfig":
        """What `as_dict` told."""
        return NetworkConfig(**{**fields, "parts": Parts(**fields.get("parts", {}))})


def network_config(joints: int, *, parts: Parts = WHOLE, **sizes: int) -> NetworkConfig:
    """Network sizes for a skeleton."""
    return NetworkConfig(
        frame=sum(frame_widths(joints).values()),
        goal=sum(goal_widths(joints).values()),
        gating=sum(gating_widths().values()),
        output=sum(output_widths(joints).values()),
        parts=parts,
        **sizes,
    )


def _joints(frame: int) -> int:
    """Of a skeleton whose characters are described by so many numbers."""
    without, with_one = (sum(frame_widths(joints).values()) for joints in (0, 1))
    return (frame - without) // (with_one - without)
