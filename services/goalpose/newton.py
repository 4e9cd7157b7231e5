"""Damped Gauss-Newton on root translation and joint rotations, for a batch of candidates.

Some 70 unknowns and a few hundred residuals: one step costs little more than one gradient of the descriptors, and a
dozen steps do what hundreds of Adam steps do. Levenberg's damping is kept per candidate; a step that does not lower
the energy is taken back.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from character.rotation import quat_from_rotvec, quat_mul, quat_normalize, quat_rotate
from torch import Tensor

from goalpose.candidates import Candidates
from goalpose.energy.angle_limit import angle_excess
from goalpose.energy.chain import point_motion
from goalpose.energy.clearance import clearance_pull
from goalpose.energy.contact import contact_pull
from goalpose.energy.descriptor import descriptor_pull
from goalpose.energy.facing import facing_rows
from goalpose.energy.figure import Figure, figure_from_pose
from goalpose.energy.floor import floor_pull
from goalpose.energy.gravity import UPRIGHT_JOINTS
from goalpose.energy.penetration import penetration_pull
from goalpose.energy.pull import Pull
from goalpose.energy.self_collision import deepest_pairs
from goalpose.energy.symmetry import symmetry_rows
from goalpose.energy.total import ReferenceModel, Settings, Target, probe_weights

LONGEST_SHIFT, LARGEST_TURN = 0.06, 0.25  # [m], [rad] in one step
PAIRS = 12  # colliding pairs of spheres looked at


@dataclass(frozen=True, eq=False)
class Quadratic:
    """The energy around B poses: value, gradient, Gauss-Newton matrix."""

    energy: Tensor  # [B]
    terms: dict[str, Tensor]  # [B] each
    gradient: Tensor  # [B, N]
    matrix: Tensor  # [B, N, N]


def expand(figure: Figure, model: ReferenceModel, target: Target, settings: Settings) -> Quadratic:
    """All terms of `total_energy` with their first and (Gauss-Newton) second order."""
    w = settings.weights
    terms: dict[str, Tensor] = {}
    pulls: list[tuple[float, Pull]] = []
    rows: list[tuple[Tensor, Tensor]] = []  # residuals [B, R] with Jacobians [B, R, N], already weighted
    if w.descriptor:
        chosen, omega = probe_weights(model, settings)
        reference = model.descriptors[chosen]
        energy, pull = descriptor_pull(target.field, target.latent, figure, model.probes, chosen, reference, omega)
        terms["descriptor"] = w.descriptor * energy
        pulls.append((w.descriptor, pull))
    if w.angle_limit:
        excess, motion = _limit_rows(figure, model)
        rows.append(_weighted(terms, "angle_limit", w.angle_limit / len(model.limits.joint), excess, motion))
    if w.floor:
        energy, pull = floor_pull(figure, target.floor_height)
        terms["floor"] = w.floor * energy
        pulls.append((w.floor, pull))
    if w.prior:
        joints = figure.positions.shape[1]
        rows.append(_weighted(terms, "prior", w.prior / joints, *_prior_rows(figure, model)))
    if w.penetration:
        energy, pull = penetration_pull(figure, model.body, target.distance, model.allowance)
        terms["penetration"] = w.penetration * energy
        pulls.append((w.penetration, pull))
    if w.contact:
        energy, pull = contact_pull(figure, model.contacts, target.distance, target.floor_height)
        terms["contact"] = w.contact * energy
        pulls.append((w.contact, pull))
    if w.clearance:
        energy, pull = clearance_pull(figure, model.body, target.distance, model.clearances)
        terms["clearance"] = w.clearance * energy
        pulls.append((w.clearance, pull))
    if w.symmetry:
        found = symmetry_rows(figure, model.body, target.distance, model.clearances, model.mirrored)
        terms["symmetry"] = w.symmetry * found[0]
        rows.append((w.symmetry**0.5 * found[1], w.symmetry**0.5 * found[2]))
    if w.facing:
        rows.append(_weighted(terms, "facing", w.facing, *facing_rows(figure, model.front, target.front)))
    if w.gravity:
        rows.append(_weighted(terms, "gravity", w.gravity / len(UPRIGHT_JOINTS), *_gravity_rows(figure, model)))
    if w.self_collision:
        rows.append(_weighted(terms, "self_collision", w.self_collision, *_collision_rows(figure, model)))
    return _assemble(figure, terms, pulls, rows)


def _weighted(
    terms: dict[str, Tensor], name: str, weight: float, residual: Tensor, motion: Tensor
) -> tuple[Tensor, Tensor]:
    """Notes the energy w sum r^2 and scales the rows so that their halved squares sum to it."""
    terms[name] = weight * residual.square().sum(-1)
    root = (2 * weight) ** 0.5
    return root * residual, root * motion


def _limit_rows(figure: Figure, model: ReferenceModel) -> tuple[Tensor, Tensor]:
    """Excess of every bounded angle; its slope by differences in the joint's own rotation vector."""
    limits, step = model.limits, 1e-3
    rotations = figure.rotations[:, limits.joint]
    excess = angle_excess(rotations, limits)
    batch, count, _ = excess.shape
    motion = torch.zeros(batch, count, 3, 3 + 3 * figure.positions.shape[1])
    for axis, unit in enumerate(torch.eye(3)):
        moved = angle_excess(quat_mul(rotations, quat_from_rotvec(step * unit).expand_as(rotations)), limits)
        motion[:, torch.arange(count), :, 3 + 3 * limits.joint + axis] = ((moved - excess) / step).transpose(0, 1)
    return excess.reshape(batch, -1), motion.reshape(batch, count * 3, -1)


def _prior_rows(figure: Figure, model: ReferenceModel) -> tuple[Tensor, Tensor]:
    """Joint positions against the reference's, both in the root's frame: the root itself does not move them."""
    joints = torch.arange(figure.positions.shape[1])
    root = figure.orientations[:, :1].expand(-1, len(joints), -1)
    expected = figure.positions[:, :1] + quat_rotate(root, model.canonical.expand(len(figure), -1, -1))
    motion = point_motion(figure, joints, figure.positions)
    motion[..., :6] = 0.0
    return (figure.positions - expected).flatten(1), motion.flatten(1, 2)


def _gravity_rows(figure: Figure, model: ReferenceModel) -> tuple[Tensor, Tensor]:
    """The reference's up direction, carried by pelvis and chest, against the world's."""
    joints = torch.tensor(figure.skeleton.indices(UPRIGHT_JOINTS))
    up = torch.tensor([0.0, 1.0, 0.0])
    carried = quat_rotate(figure.orientations[:, joints], model.gravity.expand(len(figure), -1, -1))
    origin = figure.positions[:, joints]
    motion = point_motion(figure, joints, origin + carried) - point_motion(figure, joints, origin)
    return (carried - up).flatten(1), motion.flatten(1, 2)


def _collision_rows(figure: Figure, model: ReferenceModel) -> tuple[Tensor, Tensor]:
    """Overlap of the deepest pairs of spheres."""
    overlap, first, second, points = deepest_pairs(
        figure, model.body, model.collision_pairs, model.collision_allowance, PAIRS
    )
    batch = torch.arange(len(figure))[:, None]
    a, b = points[batch, first], points[batch, second]
    normal = torch.nn.functional.normalize(b - a, dim=-1) * (overlap > 0)[..., None]
    motion = _motion_of(figure, model.body.joint[first], a) - _motion_of(figure, model.body.joint[second], b)
    return overlap.clamp(min=0.0), (normal[..., None] * motion).sum(-2)


def _motion_of(figure: Figure, joint: Tensor, points: Tensor) -> Tensor:
    """`point_motion` for points whose joints [B, P] differ between candidates."""
    parts = [point_motion(figure[slice(i, i + 1)], joint[i], points[i : i + 1]) for i in range(len(figure))]
    return torch.cat(parts)


def _assemble(
    figure: Figure, terms: dict[str, Tensor], pulls: list[tuple[float, Pull]], rows: list[tuple[Tensor, Tensor]]
) -> Quadratic:
    size = 3 + 3 * figure.positions.shape[1]
    gradient = torch.zeros(len(figure), size)
    matrix = torch.zeros(len(figure), size, size)
    for weight, pull in pulls:
        motion = point_motion(figure, pull.joint, pull.points)  # [B, P, 3, N]
        gradient += weight * (motion.flatten(1, 2) * pull.force.flatten(1)[..., None]).sum(1)
        stiff = (weight * pull.stiffness).sqrt()[..., None]
        if pull.normal is not None:
            part = stiff * (motion * pull.normal[..., None]).sum(-2)
        else:
            part = (stiff[..., None] * motion).flatten(1, 2)
        matrix += part.transpose(1, 2) @ part
    for residual, motion in rows:
        gradient += (motion * residual[..., None]).sum(1)
        matrix += motion.transpose(1, 2) @ motion
    return Quadratic(torch.stack(list(terms.values())).sum(0), terms, gradient, matrix)


def newton_step(quadratic: Quadratic, damping: Tensor, free: int) -> Tensor:
    """The damped step over the first `free` unknowns, the rest 0, limited in length. `damping` [B] -> [B, N]."""
    g, h = quadratic.gradient[:, :free], quadratic.matrix[:, :free, :free]
    diagonal = torch.diagonal(h, dim1=-2, dim2=-1)
    floor = 1e-3 * diagonal.amax(dim=-1, keepdim=True) + 1e-9
    regular = h + torch.diag_embed(damping[:, None] * (diagonal + floor) + 1e-2 * floor)
    step = -torch.linalg.solve(regular, g[..., None])[..., 0]
    shift = step[:, :3].norm(dim=-1, keepdim=True) / LONGEST_SHIFT
    turn = step[:, 3:].abs().amax(dim=-1, keepdim=True) / LARGEST_TURN
    step = step / torch.maximum(shift, turn).clamp(min=1.0)
    return torch.cat([step, torch.zeros(len(g), quadratic.gradient.shape[1] - free)], dim=-1)


def moved(figure: Figure, step: Tensor) -> Figure:
    """The poses after a step [B, N]."""
    turn = step[:, 3:].reshape(len(figure), -1, 3)
    rotations = quat_normalize(quat_mul(figure.rotations, quat_from_rotvec(turn)))
    return figure_from_pose(figure.skeleton, figure.root_position + step[:, :3], rotations)


@torch.no_grad()
def minimise(
    figure: Figure,
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
    free = 3 + 3 * figure.positions.shape[1] if joints else 6
    with torch.enable_grad():
        now = expand(figure, model, target, settings)
    damping = torch.full((len(figure),), 1e-2)
    for iteration in range(iterations):
        trial = moved(figure, newton_step(now, damping, free))
        with torch.enable_grad():
            ahead = expand(trial, model, target, settings)
        gain = now.energy - ahead.energy
        won = gain > 0
        figure, now = _blend(won, trial, figure), _blend_quadratic(won, ahead, now)
        damping = torch.where(won, damping * 0.3, damping * 6.0).clamp(1e-5, 1e3)
        watch(iteration + 1, Candidates(figure, now.energy, now.terms))
        if bool((gain[won] < tolerance).all()) and bool((damping[~won] > 30.0).all()):
            break
    return Candidates(figure, now.energy, now.terms)


def _blend(won: Tensor, new: Figure, old: Figure) -> Figure:
    return Figure(
        old.skeleton,
        torch.where(won[:, None], new.root_position, old.root_position),
        torch.where(won[:, None, None], new.rotations, old.rotations),
        torch.where(won[:, None, None], new.positions, old.positions),
        torch.where(won[:, None, None], new.orientations, old.orientations),
    )


def _blend_quadratic(won: Tensor, new: Quadratic, old: Quadratic) -> Quadratic:
    return Quadratic(
        torch.where(won, new.energy, old.energy),
        {name: torch.where(won, term, old.terms[name]) for name, term in new.terms.items()},
        torch.where(won[:, None], new.gradient, old.gradient),
        torch.where(won[:, None, None], new.matrix, old.matrix),
    )
