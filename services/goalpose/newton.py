"""Damped Gauss-Newton on root translation and joint rotations, for a batch of candidates.

Some 70 unknowns and a few hundred residuals: one step costs little more than one gradient of the descriptors, and a
dozen steps do what hundreds of Adam steps do. Levenberg's damping is kept per candidate; a step that does not lower
the energy is taken back.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from character.rotation import quat_from_rotvec, quat_mul, quat_normalize
from torch import Tensor

from goalpose.candidates import Candidates
from goalpose.energy.angle_limit import angle_limit, excess_and_motion
from goalpose.energy.chain import Chain
from goalpose.energy.clearance import clearance
from goalpose.energy.constraint import constraint, constraint_misses, constraint_motion
from goalpose.energy.contact import contact
from goalpose.energy.descriptor import descriptor_rows
from goalpose.energy.facing import carried_front, facing
from goalpose.energy.figure import Figure, figure_from_pose
from goalpose.energy.floor import floor
from goalpose.energy.gravity import carried_up, gravity, upright_joints
from goalpose.energy.penetration import penetration
from goalpose.energy.prior import prior, prior_motion
from goalpose.energy.rows import Bend, Rows, rows_concat, rows_of, weighed
from goalpose.energy.self_collision import self_collision_rows
from goalpose.energy.symmetry import symmetry, symmetry_motion
from goalpose.energy.total import ReferenceModel, Settings, Target, probe_weights

LONGEST_SHIFT, LARGEST_TURN = 0.06, 0.25  # [m], [rad] in one step


@dataclass(frozen=True, eq=False)
class Quadratic:
    """The energy around B poses: value, gradient, Gauss-Newton matrix."""

    energy: Tensor  # [B]
    terms: dict[str, Tensor]  # [B] each
    gradient: Tensor  # [B, N]
    matrix: Tensor  # [B, N, N]


@dataclass(frozen=True, eq=False)
class Expansion:
    """The terms gathered so far, with first and (Gauss-Newton) second order in the first `free` unknowns."""

    free: int
    terms: dict[str, Tensor]  # weighted, [B] each
    rows: list[Rows]

    def add(self, name: str, energy: Tensor, rows: Rows) -> None:
        """Notes a weighted term."""
        self.terms[name] = energy
        self.rows.append(rows)

    def bend(self, name: str, bend: Bend, motion: Tensor) -> None:
        """Notes a weighted term of scalars that move by `motion` [B, K, N]."""
        self.add(name, bend.energy, rows_of(bend, motion[..., : self.free]))

    def quadratic(self) -> Quadratic:
        """All terms together."""
        motion, slope, stiffness = rows_concat(self.rows)
        gradient = (slope[:, None] @ motion)[:, 0]
        matrix = motion.transpose(1, 2) @ (stiffness[..., None] * motion)
        return Quadratic(torch.stack(list(self.terms.values())).sum(0), self.terms, gradient, matrix)


@torch.no_grad()
def expand(
    figure: Figure, model: ReferenceModel, target: Target, settings: Settings, *, joints: bool = True
) -> Quadratic:
    """All terms of `total_energy` with their first and (Gauss-Newton) second order; without `joints` the root's."""
    chain = Chain.of(figure, joints=joints)
    found = Expansion(chain.screws.shape[-1], {}, [])
    if settings.weights.descriptor:
        chosen, omega = probe_weights(model, settings)
        reference, weight = model.descriptors_at(chosen), settings.weights.descriptor * omega
        field, latent = target.field, target.latent
        found.add("descriptor", *descriptor_rows(field, latent, figure, chain, model.probes, chosen, reference, weight))
    _expand_skeleton(found, chain, figure, model, target, settings)
    _expand_contacts(found, chain, figure, model, target, settings)
    _expand_body(found, chain, figure, model, target, settings)
    return found.quadratic()


def _expand_skeleton(
    found: Expansion, chain: Chain, figure: Figure, model: ReferenceModel, target: Target, settings: Settings
) -> None:
    """Terms of the joints alone."""
    w = settings.weights
    if w.angle_limit:
        excess, motion = excess_and_motion(figure.rotations, model.limits)
        found.bend("angle_limit", weighed(angle_limit(excess), w.angle_limit), motion)
    moving = chain.anyhow(torch.arange(figure.positions.shape[1]), figure.positions)
    if w.floor:
        height = figure.positions[..., 1] - target.floor_height
        found.bend("floor", weighed(floor(height), w.floor), moving[:, 1::3])
    if w.prior:
        found.bend("prior", weighed(prior(figure, model.canonical), w.prior), prior_motion(moving))
    if w.facing:
        seen = carried_front(figure, model.front)
        motion = chain.turning(torch.tensor([figure.skeleton.index("hips")]), seen)
        found.bend("facing", weighed(facing(seen, target.front), w.facing), motion)
    if w.gravity:
        carried = carried_up(figure, model.gravity)
        motion = chain.turning(upright_joints(figure.skeleton), carried)
        found.bend("gravity", weighed(gravity(carried), w.gravity), motion)
    if w.constraint and target.constraints.given:
        misses = constraint_misses(figure, target.constraints)
        motion = constraint_motion(chain, figure, target.constraints)
        found.bend("constraint", weighed(constraint(misses), w.constraint), motion)


def _expand_contacts(
    found: Expansion, chain: Chain, figure: Figure, model: ReferenceModel, target: Target, settings: Settings
) -> None:
    """What the reference touches."""
    if not settings.weights.contact:
        return
    contacts = model.contacts
    points = contacts.on(figure)
    distance, normal = target.distance.tangent(points)
    up = torch.tensor([0.0, 1.0, 0.0])
    direction = torch.where(contacts.on_floor[..., None], up, normal)
    misses = contacts.misses(points[..., 1] - target.floor_height, distance)
    motion = chain.along(contacts.joint.expand(len(figure), -1), points, direction)
    found.bend("contact", weighed(contact(misses, contacts.weight), settings.weights.contact), motion)


def _expand_body(
    found: Expansion, chain: Chain, figure: Figure, model: ReferenceModel, target: Target, settings: Settings
) -> None:
    """Terms of the body's spheres."""
    w, body = settings.weights, model.body
    points = body.on(figure)
    if w.looks_at_clearances:
        distance, normal = target.distance.tangent(points)
        motion = chain.along(body.joint, points, normal)
        if w.penetration:
            sunk = penetration(distance, body.radius, model.allowance)
            found.bend("penetration", weighed(sunk, w.penetration), motion)
        if w.clearance:
            found.bend("clearance", weighed(clearance(distance, model.clearances), w.clearance), motion)
        if w.symmetry:
            sides = weighed(symmetry(distance, model.clearances, model.mirrored), w.symmetry)
            found.bend("symmetry", sides, symmetry_motion(motion, distance, model.mirrored))
    if w.self_collision:
        pairs, allowance = model.collision_pairs, model.collision_allowance
        found.add("self_collision", *self_collision_rows(chain, points, body, pairs, allowance, w.self_collision))


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
    turned = quat_normalize(quat_mul(figure.rotations[:, : turn.shape[1]], turn))
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
    figure, own = starts.figure, model.of(starts.reference)
    now = expand(figure, own, target, settings, joints=joints)
    damping = torch.full((len(figure),), 1e-2)
    for iteration in range(iterations):
        trial = moved(figure, newton_step(now, damping))
        ahead = expand(trial, own, target, settings, joints=joints)
        gain = now.energy - ahead.energy
        won = gain > 0
        figure, now = _blend(won, trial, figure), _blend_quadratic(won, ahead, now)
        damping = torch.where(won, damping * 0.3, damping * 6.0).clamp(1e-5, 1e3)
        watch(iteration + 1, Candidates(figure, starts.reference, now.energy, now.terms))
        if bool((gain[won] < tolerance).all()) and bool((damping[~won] > 30.0).all()):
            break
    return Candidates(figure, starts.reference, now.energy, now.terms)


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
