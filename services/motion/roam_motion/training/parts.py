"""The parts of the method (paper 3.2), each of which a training can do without: what is it worth?

A part is missing when its numbers are always nought: what the network is shown is masked before it is normalised, and
what it answers is masked before it is used, in roll-outs, examples and evaluations alike. An encoder that is missing
leaves its inputs to the experts as they are.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from roam_motion.animation.advance import Predict
from roam_motion.animation.blending import Blending
from roam_motion.animation.features import Inputs, widths
from roam_motion.animation.state import KEYS
from roam_motion.models.lnsm.network import Experts, MotionNetwork, NetworkConfig


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
        if not self.goal_pose:
            goal = torch.cat([torch.zeros_like(goal[:, : -KEYS * 4 - 5]), goal[:, -KEYS * 4 - 5 :]], 1)
        if not (self.gate_phase and self.gate_action):
            gating = self._gating(inputs)
        if not self.trajectory:
            ends = KEYS * 8 + 4, 4
            frame = torch.cat([frame[:, : -ends[0]], torch.zeros_like(frame[:, -ends[0] : -4]), frame[:, -4:]], 1)
        return Inputs(frame, goal, gating)

    def _gating(self, inputs: Inputs) -> Tensor:
        """The gate's inputs [B, S], which are products of labels and phase, with one of the two or neither."""
        out = torch.zeros_like(inputs.gating)
        if self.gate_phase:
            # Of four labels that add up to one the signs 2 x - 1 add up to -2.
            out[:, : 2 * KEYS] = -0.5 * inputs.gating[:, : 8 * KEYS].reshape(-1, KEYS, 4, 2).sum(2).flatten(1)
        elif self.gate_action:
            shown = torch.cat([inputs.frame[:, -4 * KEYS - 4 : -4], inputs.goal[:, -4 * KEYS - 5 :]], 1)
            out[:, : shown.shape[1]] = shown
        return out

    def answered(self, joints: int, output: Tensor) -> Tensor:
        """A raw output [B, O] without what is missing."""
        return output if self.contacts else output * ~columns(joints, "contacts")

    def of(self, joints: int, predict: Predict) -> Predict:
        """A prediction that sees and says only what is there."""
        return lambda inputs: self.answered(joints, predict(self.seen(inputs)))

    def missing(self, joints: int) -> Tensor:
        """Output columns [O] that are not learned."""
        names = [] if self.inverse else ["inverse_positions", "inverse_axes"]
        return columns(joints, *names, *([] if self.contacts else ["contacts"]))

    def network(self, config: NetworkConfig) -> MotionNetwork:
        """A fresh network."""
        network = MotionNetwork(config)
        kept = int(config.encoding if self.frame_encoder else config.frame)
        kept += int(config.encoding if self.goal_encoder else config.goal)
        if not self.frame_encoder:
            network.frame_encoder = nn.Sequential()
        if not self.goal_encoder:
            network.goal_encoder = nn.Sequential()
        if kept != 2 * config.encoding:
            network.first = Experts(int(config.experts), kept, int(config.hidden))
        return network


WHOLE = Parts()


def columns(joints: int, *names: str) -> Tensor:
    """Whether each output column [O] belongs to one of the blocks `names`."""
    sizes = widths(joints)
    return torch.cat([torch.full((width,), name in names) for name, width in sizes.items()])
