"""Examples with left and right exchanged: what a network is shown and asked, mirrored in its own numbers.

A mirrored state asks for the mirrored answer. Every batch holds examples and their mirror images in equal parts, so
that nothing in what is learned prefers a side. Joints change sides, and so do contacts; what points along +X changes
sign. The gait phase counts from the left foot's contacts: in the mirror image it is half a turn on.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from roam_motion.animation.features import Inputs, widths
from roam_motion.animation.figure import Figure
from roam_motion.animation.state import KEYS

_OTHER_SIDE = (2, 3, 0, 1)  # of the contacts left ankle, left toes, right ankle, right toes


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
    """The mirror of a figure's features (see features.py for their order)."""
    joints = torch.tensor(figure.skeleton.mirror)
    pairs = _vectors(KEYS, 2)  # places or directions (x, z) at the keys
    frame = [_joints(joints, 4), pairs, pairs, _same(4 * KEYS), _contacts()]
    goal = [_joints(joints, 3), pairs, pairs, _same(5)]
    columns = widths(figure.joint_count)
    future = columns["phase"]
    output = {
        "positions": _joints(joints, 1),
        "axes": _joints(joints, 2),
        "inverse_positions": _joints(joints, 1),
        "inverse_axes": _joints(joints, 2),
        "trajectory": _repeated([-1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0], future),
        "inverse_trajectory": _repeated([-1.0, 1.0, -1.0, 1.0], future),
        "contacts": _contacts(),
        "phase": _same(future),
    }
    assert {name: len(swap.order) for name, swap in output.items()} == columns
    # Every number for the gate has the phase vector in it, those of the goal's angle the angle too.
    styles = _repeated([-1.0] * 8, KEYS)
    actions = _repeated([-1.0, -1.0, -1.0, -1.0, 1.0, 1.0] * 4, KEYS)
    return Mirror(*(_joined(parts) for parts in (frame, goal, [styles, actions], list(output.values()))))


def _same(count: int) -> Swap:
    return Swap(torch.arange(count), torch.ones(count))


def _repeated(signs: list[float], count: int) -> Swap:
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


def _contacts() -> Swap:
    return Swap(torch.tensor(_OTHER_SIDE), torch.ones(len(_OTHER_SIDE)))


def _joined(parts: list[Swap]) -> Swap:
    start, orders = 0, []
    for part in parts:
        orders.append(part.order + start)
        start += len(part.order)
    return Swap(torch.cat(orders), torch.cat([part.sign for part in parts]))
