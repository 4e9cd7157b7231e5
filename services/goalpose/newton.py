"""Damped Gauss-Newton on root translation and joint rotations, for a batch of candidates.

Some 70 unknowns and a few hundred residuals: one step costs little more than one gradient of the descriptors, and a
dozen steps do what hundreds of Adam steps do. Levenberg's damping is kept per candidate; a step that does not lower
the energy is taken back.
"""

from collections.abc import Callable

import torch
from character.rotation import quat_from_rotvec, quat_normalize
from torch import Tensor

from goalpose.candidates import Candidates
from goalpose.energy.figure import Figure, figure_from_pose, product
from goalpose.energy.total import ReferenceModel, Settings, Target
from goalpose.expansion import Quadratic, expand

LONGEST_SHIFT, LARGEST_TURN = 0.06, 0.25  # [m], [rad] in one step


def newton_step(quadratic: Quadratic, damping: Tensor) -> Tensor:
    """The damped step, limited in length. `damping` [B] -> [B, N]."""
    g, h = quadratic.gradient, quadratic.matrix
    diagonal = torch.diagonal(h, dim1=-2, dim2=-1)
    floor = 1e-3 * diagonal.amax(dim=-1, keepdim=True) + 1e-9
    regular = h + torch.diag_embed(damping[:, None] * (diagonal + floor) + 1e-2 * floor)
    step = -torch.linalg.solve(regular, g[..., None])[..., 0]
    shift = step[:, :3].norm(dim=-1, keepdim=True) / LONGEST_SHIFT
    turn = step[:, 3:].abs().amax(dim=-1, keepdim=True) / LARGEST_TURN
    return step / torch.maximum(shift, turn).clamp(min=1.0)


def moved(figure: Figure, step: Tensor) -> Figure:
    """The poses after a step [B, N]; a step of the root alone has 6 numbers."""
    turn = quat_from_rotvec(step[:, 3:].reshape(len(figure), -1, 3))
    turned = quat_normalize(product(figure.rotations[:, : turn.shape[1]], turn))
    rotations = torch.cat([turned, figure.rotations[:, turn.shape[1] :]], dim=1)
    return figure_from_pose(figure.skeleton, figure.root_position + step[:, :3], rotations)


@torch.no_grad()
def minimise(
    starts: Candidates,
    model: ReferenceModel,
    target: Target,
    settings: Settings,
    *,
    iterations: int,
    joints: bool,
    tolerance: float = 1e-4,
    watch: Callable[[int, Candidates], None] = lambda i, c: None,
) -> Candidates:
    """Lowers the energy of every pose, moving only the root unless `joints`; stops when none gains `tolerance`."""
    own = model.of(starts.reference)
    now = expand(starts.figure, own, target, settings, joints=joints)
    found, shape = Candidates(starts.figure, starts.reference, now.energy, now.terms), now.quadratic()
    damping = torch.full((len(starts),), 1e-2)
    for iteration in range(1, iterations + 1):
        ahead = expand(moved(found.figure, newton_step(shape, damping)), own, target, settings, joints=joints)
        gain = found.energy - ahead.energy
        won = gain > 0
        found = found.replaced(won, ahead.figure, ahead.energy, ahead.terms)
        damping = torch.where(won, damping * 0.3, damping * 6.0).clamp(1e-5, 1e3)
        watch(iteration, found)
        if bool((gain[won] < tolerance).all()) and bool((damping[~won] > 30.0).all()):
            break
        if iteration < iterations and bool(won.any()):
            shape = _blend(won, ahead.quadratic(), shape)
    return found


def _blend(won: Tensor, new: Quadratic, old: Quadratic) -> Quadratic:
    """The new one of the poses that `won` [B]."""
    return Quadratic(
        torch.where(won[:, None], new.gradient, old.gradient), torch.where(won[:, None, None], new.matrix, old.matrix)
    )
