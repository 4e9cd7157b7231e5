"""Examples with left and right exchanged: what a network is shown and asked, mirrored in its own numbers.

A mirrored state asks for the mirrored answer. Every batch holds examples and their mirror images in equal parts, so
that nothing in what is learned prefers a side. Joints change sides, and so do contacts; what points along +X changes
sign. The gait phase counts from the left foot's contacts: in the mirror image it is half a turn on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from roam_motion.actions import STYLES
from roam_motion.animation.figure import Figure
from roam_motion.animation.state import KEYS
from roam_motion.models.lnsm.features import Inputs, frame_widths, gating_widths, goal_widths, output_widths

_ROOT = (-1.0, 1.0, -1.0, 1.0)  # of a root's place and direction (x, z)
# Every number for the gate has the phase vector in it, those of the goal's angle (the last of three scales) the angle
# too.
_GATED = (-1.0, -1.0, -1.0, -1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Swap:
    """Columns taken from elsewhere, some with the other sign."""

    order: Tensor  # [C]
    sign: Tensor  # [C]

    def __call__(self, rows: Tensor) -> Tensor:
        """Rows [B, C] mirrored."""
        return rows[:, self.order] * self.sign


@dataclass(frozen=True, eq=False)
class Mirror:
    """Mirrors the raw inputs and outputs of a figure's network."""

    frame: Swap
    goal: Swap
    gating: Swap
    output: Swap

    def inputs(self, inputs: Inputs) -> Inputs:
        """Raw inputs mirrored."""
        return Inputs(self.frame(inputs.frame), self.goal(inputs.goal), self.gating(inputs.gating))


def mirror_of(figure: Figure) -> Mirror:
    """The mirror of a figure's features (see models.lnsm.features for their order)."""
    joints, contacts = torch.tensor(figure.skeleton.mirror), _contacts(figure)
    pairs = _vectors(KEYS, 2)  # places or directions (x, z) at the keys
    styles, ahead = len(STYLES), output_widths(figure.joint_count)["phase"]
    frame = {
        "pose": _joints(joints, 4),
        "places": pairs,
        "directions": pairs,
        "styles": _same(styles * KEYS),
        "contacts": contacts,
    }
    goal = {
        "pose": _joints(joints, 3),
        "places": pairs,
        "directions": pairs,
        "action": _same(styles),
        "settled": _same(1),
    }
    gating = {"styles": _repeated([-1.0, -1.0], styles * KEYS), "actions": _repeated(_GATED, styles * KEYS)}
    output = {
        "positions": _joints(joints, 1),
        "axes": _joints(joints, 2),
        "inverse_positions": _joints(joints, 1),
        "inverse_axes": _joints(joints, 2),
        "trajectory": _repeated([*_ROOT, *[1.0] * styles], ahead),
        "inverse_trajectory": _repeated(_ROOT, ahead),
        "contacts": contacts,
        "phase": _same(ahead),
    }
    count = figure.joint_count
    widths = frame_widths(count), goal_widths(count), gating_widths(), output_widths(count)
    return Mirror(*(_joined(*blocks) for blocks in zip((frame, goal, gating, output), widths, strict=True)))


def _same(count: int) -> Swap:
    return Swap(torch.arange(count), torch.ones(count))


def _repeated(signs: Sequence[float], count: int) -> Swap:
    sign = torch.tensor(signs).repeat(count)
    return Swap(torch.arange(len(sign)), sign)


def _vectors(count: int, width: int) -> Swap:
    """Vectors that begin with x."""
    return _repeated([-1.0] + [1.0] * (width - 1), count)


def _joints(mirror: Tensor, vectors: int) -> Swap:
    """Joints [J] with so many vectors each."""
    width = 3 * vectors
    order = (mirror[:, None] * width + torch.arange(width)).flatten()
    return Swap(order, _vectors(len(mirror) * vectors, 3).sign)


def _contacts(figure: Figure) -> Swap:
    contacts = figure.contacts.tolist()
    order = [contacts.index(figure.skeleton.mirror[joint]) for joint in contacts]
    return Swap(torch.tensor(order), torch.ones(len(order)))


def _joined(blocks: Mapping[str, Swap], widths: Mapping[str, int]) -> Swap:
    """Blocks side by side; they have to be those of `widths`, in its order. ValueError when they are not."""
    if [(name, len(swap.order)) for name, swap in blocks.items()] != list(widths.items()):
        raise ValueError(f"the mirror knows other blocks than the network's features: {dict(widths)}")
    start, orders = 0, []
    for swap in blocks.values():
        orders.append(swap.order + start)
        start += len(swap.order)
    return Swap(torch.cat(orders), torch.cat([swap.sign for swap in blocks.values()]))
