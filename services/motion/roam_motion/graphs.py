"""The step's arithmetic as graphs: the parts of `advance`, traced once when weights are loaded.

A frame is some six hundred small tensor operations. Called one by one from Python they take twice as long as they
compute, and between them hold the interpreter's lock, which the event loop needs to send frames. Only `cleared` stays
outside: it looks at few characters and passes over those that touch nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from roam_character.tensors.torchscript import frozen, running
from torch import Tensor

from roam_motion.animation.advance import Proposal, cleared, propose, settle
from roam_motion.animation.blending import Blending
from roam_motion.animation.collision import Furniture
from roam_motion.animation.figure import CONTACT_JOINTS, Figure
from roam_motion.animation.prediction import Goals, Predict, goal_shapes
from roam_motion.animation.rows import join, row_width, split_array
from roam_motion.animation.shown.landing import lingering
from roam_motion.animation.shown.living import WIDTH as LIFE
from roam_motion.animation.shown.living import Life, alive, gazed
from roam_motion.animation.shown.swing import swinging, walking
from roam_motion.animation.state import ROOT, STYLE, Characters, characters_width

_EXAMPLES = 2  # characters that the graphs are traced with; they hold for any number
_SNORM16 = 32767


@dataclass(frozen=True, eq=False)
class Shown:
    """B characters after a step, and their frames to show."""

    rows: np.ndarray  # [B, D] of `Characters`
    root: np.ndarray  # [B, 7] hips [m], their rotation xyzw
    rotations: np.ndarray  # [B, J, 4] local, xyzw
    snorm16: np.ndarray  # [B, J, 4] int16: the same times 32767
    positions: np.ndarray  # [B, J, 3] [m]
    contacts: np.ndarray  # [B, 4] 1 held, 0 free
    style: np.ndarray  # [B] index of the style
    apart: np.ndarray  # [B] mean joint distance to the goal pose [m]


class Graphs:
    """Functions of characters' numbers; the same bits whatever else is in the batch."""

    def __init__(self, figure: Figure, prediction: Predict, blending: Blending) -> None:
        self._figure, self._shapes = figure, _shown_shapes(figure.joint_count)
        self._widths = [characters_width(figure.joint_count), row_width(goal_shapes(figure.joint_count)), LIFE]

        def seen(numbers: Tensor) -> Tensor:
            return _bodies(figure, Characters.of(numbers))

        def proposed(numbers: Tensor) -> tuple[Tensor, ...]:
            characters, goals, _ = self._inputs(numbers)
            return tuple(vars(propose(figure, prediction, characters, goals, blending)).values())

        def shown(numbers: Tensor, pushed: Tensor, *proposal: Tensor) -> tuple[Tensor, Tensor]:
            characters, goals, life = self._inputs(numbers)
            after, joints = settle(figure, characters, Proposal(*proposal), pushed)
            after = replace(after, linger=lingering(after, characters.hips, goals))
            return _shown(figure, after, joints, goals.pose_positions, life)

        def stepped(numbers: Tensor) -> tuple[Tensor, Tensor]:
            proposal, pushed = self._cleared(numbers, proposed(numbers), None)
            return shown(numbers, pushed, *vars(proposal).values())

        numbers = torch.zeros(_EXAMPLES, sum(self._widths))
        proposal, pushed = self._cleared(numbers, proposed(numbers), None)
        self._bodies, self._propose = frozen(seen, numbers[:, : self._widths[0]]), frozen(proposed, numbers)
        self._show = frozen(shown, numbers, pushed, *vars(proposal).values())
        self._step = frozen(stepped, numbers)

    def bodies(self, rows: np.ndarray) -> list[list[float]]:
        """Of every character x, z, its direction, the hips' height, the middle of its ankles x, z, and its manner."""
        with running():
            found: Tensor = self._bodies(torch.from_numpy(rows))
        return found.tolist()

    def step(
        self, rows: np.ndarray, goals: np.ndarray, life: np.ndarray, around: tuple[Tensor, Furniture] | None
    ) -> Shown:
        """`advance` on the numbers of characters [B, D] and goals [B, G]; `life` [B, 8] of `Life`."""
        numbers = torch.from_numpy(np.concatenate([rows, goals, life], 1))
        with running():
            if around is None:
                found, short = self._step(numbers)
            else:
                proposal, pushed = self._cleared(numbers, self._propose(numbers), around)
                found, short = self._show(numbers, pushed, *vars(proposal).values())
        after, frames = np.split(found.numpy(), [rows.shape[1]], axis=1)
        return Shown(after, snorm16=short.numpy().copy(), **split_array(frames.copy(), self._shapes))

    def _inputs(self, numbers: Tensor) -> tuple[Characters, Goals, Life]:
        """Characters, goals and what their living idle is told, of the graphs' input."""
        rows, goals, life = numbers.split(self._widths, 1)
        return Characters.of(rows), Goals.of(goals, self._figure.joint_count), Life.of(life)

    def _cleared(
        self, numbers: Tensor, proposal: Sequence[Tensor], around: tuple[Tensor, Furniture] | None
    ) -> tuple[Proposal, Tensor]:
        characters, goals, _ = self._inputs(numbers)
        return cleared(self._figure, characters, goals, Proposal(*proposal), around)


def _bodies(figure: Figure, characters: Characters) -> Tensor:
    positions = figure.positions(characters.hips, characters.orientations)
    feet = positions.index_select(1, figure.legs[:, 2])[..., ::2].mean(1)
    return torch.cat([characters.past[:, -1, ROOT], characters.hips[:, 1:2], feet, characters.manner], 1)


def _shown(figure: Figure, after: Characters, joints: Tensor, goal: Tensor, life: Life) -> tuple[Tensor, Tensor]:
    """Rows of characters, whose `joints` are [B, J, 3], and of `_shown_shapes` side by side; rotations as int16."""
    after = replace(after, gaze=gazed(figure, after, joints, life))
    walks = walking(after)
    orientations = swinging(figure, joints, after.orientations, walks, after.manner)
    hips, orientations = alive(figure, after, orientations, life, walks)
    positions = figure.positions(hips, orientations)
    rotations = figure.rotations(orientations)
    frame = {
        "root": torch.cat([hips, rotations[:, 0]], 1),
        "rotations": rotations,
        "positions": positions,
        "contacts": (after.lock_weights >= 1).float(),
        "style": after.past[:, -1, STYLE].argmax(-1).float(),
        "apart": torch.linalg.vector_norm(positions - goal, dim=-1).mean(-1),
    }
    short = (rotations.clamp(-1.0, 1.0) * _SNORM16).round().to(torch.int16)
    return torch.cat([after.rows(), join(frame)], 1), short


def _shown_shapes(joints: int) -> dict[str, tuple[int, ...]]:
    return {
        "root": (7,),
        "rotations": (joints, 4),
        "positions": (joints, 3),
        "contacts": (len(CONTACT_JOINTS),),
        "style": (),
        "apart": (),
    }
