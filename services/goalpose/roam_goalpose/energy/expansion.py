"""The energy around a batch of poses: its terms at once, gradient and Gauss-Newton matrix when they are wanted.

A step that does not lower the energy is taken back: of its pose only the energy was needed, a third of the work.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, reduce

import torch
from torch import Tensor

from roam_goalpose.energy.angle_limit import angle_excess, angle_limit, excess_motion
from roam_goalpose.energy.chain import Chain
from roam_goalpose.energy.clearance import clearance
from roam_goalpose.energy.constraint import constraint, constraint_misses, constraint_motion
from roam_goalpose.energy.contact import contact
from roam_goalpose.energy.descriptor import descriptor_bend
from roam_goalpose.energy.facing import carried_front, facing, hips_joint
from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.floor import floor
from roam_goalpose.energy.gravity import carried_up, gravity, upright_joints
from roam_goalpose.energy.penetration import penetration
from roam_goalpose.energy.prior import prior, prior_motion
from roam_goalpose.energy.rows import Bend, Rows, rows_concat, rows_of, weighed
from roam_goalpose.energy.self_collision import deepest_pairs
from roam_goalpose.energy.symmetry import symmetry, symmetry_motion
from roam_goalpose.energy.total import Aim, ReferenceModel, Settings, Target

_UP = torch.tensor([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Quadratic:
    """How the energy bends around B poses: gradient and Gauss-Newton matrix."""

    gradient: Tensor  # [B, N]
    matrix: Tensor  # [B, N, N]

    def __getitem__(self, index: slice) -> "Quadratic":
        return Quadratic(self.gradient[index], self.matrix[index])


def quadratic_concat(parts: Sequence[Quadratic]) -> Quadratic:
    """Several batches as one."""
    return Quadratic(torch.cat([part.gradient for part in parts]), torch.cat([part.matrix for part in parts]))


def quadratic_where(won: Tensor, new: Quadratic, old: Quadratic) -> Quadratic:
    """The new ones of the poses that `won` [B]."""
    return Quadratic(
        torch.where(won[:, None], new.gradient, old.gradient), torch.where(won[:, None, None], new.matrix, old.matrix)
    )


@dataclass(frozen=True, eq=False)
class Expansion:
    """All terms of the energy of B poses, and how to find their first and second order in the unknowns."""

    figure: Figure
    joints: bool  # False: only the root moves
    terms: dict[str, Tensor] = field(default_factory=dict)  # weighted, [B] each
    rows: list[Callable[[], Rows]] = field(default_factory=list)

    @cached_property
    def energy(self) -> Tensor:
        """[B], added term by term: a sum over a tensor's first axis rounds as the size of the batch would have it."""
        return reduce(torch.add, self.terms.values())

    @cached_property
    def chain(self) -> Chain:
        """How points move with the unknowns."""
        return Chain.of(self.figure, joints=self.joints)

    @cached_property
    def moving(self) -> Tensor:
        """How the joints do. [B, 3 J, N]."""
        return self.chain.anyhow(torch.arange(self.figure.positions.shape[1]), self.figure.positions)

    def add(self, name: str, energy: Tensor, rows: Callable[[], Rows]) -> None:
        """Notes a weighted term."""
        self.terms[name] = energy
        self.rows.append(rows)

    def bend(self, name: str, weight: float, bend: Bend, motion: Callable[[], Tensor]) -> None:
        """Notes a term of scalars that move by `motion` [B, K, N]."""
        heavy = weighed(bend, weight)
        self.add(name, heavy.energy, lambda: rows_of(heavy, motion()))

    def inner(self, name: str, weight: float, bend: Bend, motion: Callable[[], Tensor]) -> None:
        """Notes a term that moving the root alone does not change."""
        if self.joints:
            self.bend(name, weight, bend, motion)
        else:
            self.terms[name] = weight * bend.energy

    @torch.no_grad()
    def quadratic(self) -> Quadratic:
        """All terms together."""
        motion, slope, stiffness = rows_concat([rows() for rows in self.rows])
        gradient = (slope[:, None] @ motion)[:, 0]
        return Quadratic(gradient, motion.transpose(1, 2) @ (stiffness[..., None] * motion))


@torch.no_grad()
def expand(
    figure: Figure,
    model: ReferenceModel,
    target: Target,
    settings: Settings,
    *,
    joints: bool = True,
    aim: Aim | None = None,
) -> Expansion:
    """All terms of `total_energy`; without `joints` in the unknowns of the root alone. `aim` as `Aim.of` makes it, for
    those who expand again and again."""
    found = Expansion(figure, joints)
    if settings.weights.descriptor:
        aim = aim or Aim.of(model, settings)
        weight = settings.weights.descriptor * aim.omega
        joint, points = model.probes.on(figure, aim.chosen)
        bend = descriptor_bend(target.field, target.latent, points, aim.descriptors, weight, objects=target.objects)
        found.add("descriptor", bend.energy, lambda: bend.rows(found.chain.anyhow(joint, points)))
    _expand_skeleton(found, model, target, settings)
    _expand_contacts(found, model, target, settings)
    _expand_body(found, model, target, settings)
    return found


def _expand_skeleton(found: Expansion, model: ReferenceModel, target: Target, settings: Settings) -> None:
    """Terms of the joints alone."""
    w, figure = settings.weights, found.figure
    if w.angle_limit:
        excess = angle_excess(figure.rotations.index_select(1, model.limits.joint), model.limits)
        found.inner("angle_limit", w.angle_limit, angle_limit(excess), lambda: excess_motion(figure, model.limits))
    if w.floor:
        height = figure.positions[..., 1] - target.floor_height
        found.bend("floor", w.floor, floor(height), lambda: found.moving[:, 1::3])
    if w.prior:
        found.inner("prior", w.prior, prior(figure, model.canonical), lambda: prior_motion(found.moving))
    if w.facing:
        seen, hips = carried_front(figure, model.front), hips_joint(figure.skeleton)
        found.bend("facing", w.facing, facing(seen, target.front), lambda: found.chain.turning(hips, seen))
    if w.gravity:
        carried, upright = carried_up(figure, model.gravity), upright_joints(figure.skeleton)
        found.bend("gravity", w.gravity, gravity(carried), lambda: found.chain.turning(upright, carried))
    wishes = target.constraints
    if w.constraint and wishes.given:
        misses = constraint(constraint_misses(figure, wishes))
        found.bend("constraint", w.constraint, misses, lambda: constraint_motion(found.chain, figure, wishes))


def _expand_contacts(found: Expansion, model: ReferenceModel, target: Target, settings: Settings) -> None:
    """What the reference touches."""
    if not settings.weights.contact:
        return
    contacts = model.contacts
    points = contacts.on(found.figure)
    distance, normal = target.distance.tangent(points)
    direction = torch.where(contacts.on_floor[..., None], _UP, normal)
    misses = contacts.misses(points[..., 1] - target.floor_height, distance)
    joint = contacts.joint.expand(len(points), -1)
    bend = contact(misses, contacts.weight)
    found.bend("contact", settings.weights.contact, bend, lambda: found.chain.along(joint, points, direction))


def _expand_body(found: Expansion, model: ReferenceModel, target: Target, settings: Settings) -> None:
    """Terms of the body's spheres."""
    w, body = settings.weights, model.body
    if not w.looks_at_the_body:
        return
    points = body.on(found.figure)
    if w.looks_at_clearances:
        _expand_clearances(found, points, model, target, settings)
    if w.self_collision:
        pairs = deepest_pairs(points, body, model.collision_pairs, model.collision_allowance)
        found.inner("self_collision", w.self_collision, pairs.bend(), lambda: pairs.motion(found.chain, body))


def _expand_clearances(
    found: Expansion, points: Tensor, model: ReferenceModel, target: Target, settings: Settings
) -> None:
    """Terms of the distance between the spheres at `points` [B, P, 3] and the object."""
    w, body = settings.weights, model.body
    distance, normal = target.distance.tangent(points)
    motion = cache(lambda: found.chain.along(body.joint, points, normal))
    if w.penetration:
        found.bend("penetration", w.penetration, penetration(distance, body.radius, model.allowance), motion)
    if w.clearance:
        found.bend("clearance", w.clearance, clearance(distance, model.clearances), motion)
    if w.symmetry:
        sides = symmetry(distance, model.clearances, model.mirrored)
        found.bend("symmetry", w.symmetry, sides, lambda: symmetry_motion(motion(), distance, model.mirrored))
