"""Batched Adam over root translation and joint rotations that keeps every candidate's best iterate."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from roam_character.rotation import quat_from_rotvec, quat_mul
from torch import Tensor

from roam_goalpose.energy.figure import Figure, figure_from_pose
from roam_goalpose.energy.objective import Objective
from roam_goalpose.solvers.candidates import Candidates


@dataclass(frozen=True)
class Schedule:
    """One stage of optimisation."""

    iterations: int
    translation_rate: float  # [m] per iteration
    rotation_rate: float  # [rad] per iteration
    joints: bool  # False: only the root moves
    decay: float = 1.0  # learning rate at the end over that at the start


def descend(
    figure: Figure,
    objective: Objective,
    schedule: Schedule,
    *,
    watch: Callable[[int, Candidates], None] = lambda i, c: None,
) -> Candidates:
    """Minimises `objective` for each of the B poses on their own; returns the best iterate of each.

    Rotations are changed by local rotation vectors on top of the given ones, R = R_0 exp(v), so that no angle wraps.
    """
    start_root, start = figure.root_position.detach(), figure.rotations.detach()
    move = torch.zeros_like(start_root, requires_grad=True)
    turn = torch.zeros(*start.shape[:-1], 3, requires_grad=True)
    optimiser = torch.optim.Adam(
        [{"params": [move], "lr": schedule.translation_rate}, {"params": [turn], "lr": schedule.rotation_rate}]
    )
    fall = schedule.decay ** (1.0 / max(1, schedule.iterations - 1))
    best: Candidates | None = None
    for iteration in range(schedule.iterations + 1):
        now = figure_from_pose(figure.skeleton, start_root + move, quat_mul(start, quat_from_rotvec(turn)))
        found = objective.at(now)
        best = _better(best, _detached(now, found.energy, found.terms))
        watch(iteration, best)
        if iteration == schedule.iterations:
            break
        optimiser.zero_grad(set_to_none=True)
        torch.autograd.backward(found.energy.sum())
        if not schedule.joints and turn.grad is not None:
            turn.grad[:, 1:] = 0.0
        optimiser.step()
        for group in optimiser.param_groups:
            group["lr"] *= fall
    assert best is not None
    return best


def _detached(figure: Figure, energy: Tensor, terms: dict[str, Tensor]) -> Candidates:
    still = Figure(
        figure.skeleton,
        figure.root_position.detach().clone(),
        figure.rotations.detach(),
        figure.positions.detach(),
        figure.orientations.detach(),
    )
    finite = torch.nan_to_num(energy.detach(), nan=float("inf"))
    return Candidates(
        still, torch.zeros(len(still), dtype=torch.long), finite, {name: term.detach() for name, term in terms.items()}
    )


def _better(best: Candidates | None, now: Candidates) -> Candidates:
    """Per candidate the better of two iterates."""
    if best is None:
        return now
    return best.replaced(now.energy < best.energy, now)
