"""The step's arithmetic as TorchScript graphs: the parts of `advance`, traced once when weights are loaded.

A frame is some six hundred small tensor operations. Called one by one from Python they take twice as long as they
compute, and between them hold the interpreter's lock, which the event loop needs to send frames. Only `cleared` stays
outside: it looks at few characters and passes over those that touch nothing.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from motion.advance import Proposal, cleared, propose, sense, settle
from motion.blending import Blending
from motion.clearance import Furniture
from motion.features import Goals
from motion.figure import Figure
from motion.living import alive, stillness
from motion.prediction import Prediction
from motion.state import KEYS, Characters, characters_width

_EXAMPLES = 2  # characters that the graphs are traced with; they hold for any number
_SNORM16 = 32767


@dataclass(frozen=True, eq=False)
class Shown:
    """B characters after a step, and their frames to show."""

    rows: Tensor  # [B, D] of `Characters`
    root: Tensor  # [B, 7] hips [m], their rotation xyzw
    rotations: Tensor  # [B, J, 4] local, xyzw
    snorm16: Tensor  # [B, J, 4] int16: the same times 32767
    positions: Tensor  # [B, J, 3] [m]
    apart: Tensor  # [B] mean joint distance to the goal pose [m]
    contacts: Tensor  # [B, 4] bool
    style: Tensor  # [B] index of the action


class Graphs:
    """Functions of characters' numbers; the same bits whatever else is in the batch."""

    def __init__(self, figure: Figure, prediction: Prediction, blending: Blending) -> None:
        self._figure, self._prediction = figure, prediction

        def seen(rows: Tensor) -> Tensor:
            return _bodies(figure, Characters.of(rows))

        def sensed(rows: Tensor, *goals: Tensor) -> Tensor:
            return prediction.normalised(sense(figure, Characters.of(rows), Goals(*goals)))

        def proposed(rows: Tensor, output: Tensor, *goals: Tensor) -> tuple[Tensor, ...]:
            return _flat(propose(figure, output, Characters.of(rows), Goals(*goals), blending))

        def shown(rows: Tensor, clock: Tensor, goal: Tensor, pushed: Tensor, *proposal: Tensor) -> tuple[Tensor, ...]:
            after, _ = settle(figure, Characters.of(rows), Proposal(*proposal), pushed)
            return _flat(_shown(figure, after, goal, clock))

        rows, goals = torch.zeros(_EXAMPLES, characters_width(figure.joint_count)), _flat(_no_goals(figure))
        self._bodies = _traced(seen, rows)
        self._sense = _traced(sensed, rows, *goals)
        output = prediction.answers(self._sense(rows, *goals))
        self._propose = _traced(proposed, rows, output, *goals)
        proposal, pushed = self._propose(rows, output, *goals), torch.zeros(_EXAMPLES, 2, dtype=torch.bool)
        self._show = _traced(shown, rows, rows[:, 0], goals[4], pushed, *proposal)

    def bodies(self, rows: Tensor) -> list[list[float]]:
        """Of every character x, z, the direction it faces, the hips' height, and the middle of its ankles x, z."""
        with torch.jit.optimized_execution(False):
            found: Tensor = self._bodies(rows)
        return found.tolist()

    def step(self, rows: Tensor, goals: Goals, clock: Tensor, around: tuple[Tensor, Furniture] | None) -> Shown:
        """`advance` on characters' numbers [B, D]; `clock` [B] of their living idle [s]."""
        # Optimising costs the first frames a tenth of a second each and later ones gain nothing.
        with torch.jit.optimized_execution(False):
            output = self._prediction.answers(self._sense(rows, *_flat(goals)))
            proposal = Proposal(*self._propose(rows, output, *_flat(goals)))
            proposal, pushed = cleared(self._figure, proposal, around)
            return Shown(*self._show(rows, clock, goals.pose_positions, pushed, *_flat(proposal)))


def _traced(function: Callable[..., Any], *example: Tensor) -> Callable[..., Any]:
    with torch.inference_mode(False), torch.no_grad(), warnings.catch_warnings():
        # It warns of each shape and constant that it takes for given: none of these depends on the characters.
        warnings.simplefilter("ignore", torch.jit.TracerWarning)
        graph: Callable[..., Any] = torch.jit.trace(function, example, check_trace=False)
    return graph


def _flat(record: object) -> tuple[Tensor, ...]:
    """The fields of a record, in order: graphs take and give tensors alone."""
    return tuple(vars(record).values())


def _bodies(figure: Figure, characters: Characters) -> Tensor:
    positions = figure.positions(characters.hips, characters.orientations)
    feet = positions.index_select(1, figure.legs[:, 2])[..., ::2].mean(1)
    return torch.cat([characters.past[:, -1, :4], characters.hips[:, 1:2], feet], 1)


def _shown(figure: Figure, after: Characters, goal: Tensor, clock: Tensor) -> Shown:
    orientations = alive(figure, after.orientations, stillness(after), clock)
    positions = figure.positions(after.hips, orientations)
    rotations = figure.rotations(orientations)
    return Shown(
        rows=after.rows(),
        root=torch.cat([after.hips, rotations[:, 0]], 1),
        rotations=rotations,
        snorm16=(rotations.clamp(-1.0, 1.0) * _SNORM16).round().to(torch.int16),
        positions=positions,
        apart=torch.linalg.vector_norm(positions - goal, dim=-1).mean(-1),
        contacts=after.lock_weights >= 1,
        style=after.past[:, -1, 4:8].argmax(-1),
    )


def _no_goals(figure: Figure) -> Goals:
    """Goals of as many characters as the graphs are traced with."""
    count, joints = _EXAMPLES, figure.joint_count
    return Goals(
        positions=torch.zeros(count, KEYS, 2),
        directions=torch.zeros(count, KEYS, 2),
        action=torch.zeros(count, 4),
        active=torch.zeros(count),
        pose_positions=torch.zeros(count, joints, 3),
        pose_orientations=torch.zeros(count, joints, 3, 3),
        urgency=torch.zeros(count),
    )
