"""Damped Gauss-Newton on root translation and joint rotations, for a batch of candidates.

Some 70 unknowns and a few hundred residuals: one step costs little more than one gradient of the descriptors, and a
dozen steps do what hundreds of Adam steps do. Levenberg's damping is kept per candidate; a step that does not lower
the energy is taken back. Several requests can share their steps: a batch twice as large costs far less than two. Every
sum runs over one pose's own numbers or is a matrix product of one object's own queries; whether a request then gets the
same bits in company as alone is up to the processor's kernels, and `sharing` holds them to it.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace

import torch
from roam_character.rotation import quat_from_rotvec, quat_mul, quat_normalize
from torch import Tensor

from roam_goalpose.energy.figure import Figure, figure_concat, figure_from_pose
from roam_goalpose.energy.object import SignedDistance
from roam_goalpose.energy.objective import Expansion, Objective, Quadratic, quadratic_concat, quadratic_where
from roam_goalpose.energy.reference import ReferenceModel, models_stack
from roam_goalpose.energy.scene import Settings, Target
from roam_goalpose.field.latent import latent_concat
from roam_goalpose.solvers.candidates import Candidates

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
    turned = quat_normalize(quat_mul(figure.rotations[:, : turn.shape[1]], turn))
    rotations = torch.cat([turned, figure.rotations[:, turn.shape[1] :]], dim=1)
    return figure_from_pose(figure.skeleton, figure.root_position + step[:, :3], rotations)


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """One stage of one request: poses whose energy is to be lowered, and for how long."""

    starts: Candidates
    model: ReferenceModel  # of the references that the starts are made from
    target: Target
    settings: Settings
    iterations: int
    joints: bool  # False: only the root moves
    tolerance: float = 1e-4  # of energy: it ends when no pose gains more in a step ...
    patience: int = 1  # ... as often in a row
    watch: Callable[[int, Candidates], None] = lambda i, c: None  # told after every iteration; stops it by raising

    @property
    def shape(self) -> Hashable:
        """What decides the shapes of all its tensors, and so the kernels that compute them."""
        return len(self.starts), self.model.width, self.settings, self.joints

    @property
    def kind(self) -> Hashable:
        """Problems of one kind can share their steps: they differ in numbers only."""
        target = self.target
        alone = id(self) if target.constraints.given else None
        return self.shape, target.floor_height, id(target.field), alone


def minimise(problem: Problem) -> Candidates:
    """Every pose with its energy lowered; raises what `watch` raises."""
    (found,) = minimise_together([problem])
    if isinstance(found, Exception):
        raise found
    return found


@torch.no_grad()
def minimise_together(problems: Sequence[Problem]) -> list[Candidates | Exception]:
    """`minimise` for problems of one kind, step by step together: to the bit what each gets alone.

    Each ends when it is done, or when its `watch` raises, which the others do not notice.
    """
    runs = [_Run(problem) for problem in problems]
    going = runs
    while going:
        batch = _Batch.of(going)
        if going is runs:
            batch.begin()
        while going == batch.runs:
            batch.step()
            going = [run for run in going if not run.ended]
    return [run.failure or run.found for run in runs]


class _Run:
    """A problem on its way."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.found = problem.starts
        self.shape: Quadratic  # around `found`
        self.damping = torch.full((len(problem.starts),), 1e-2)
        self.idle = torch.zeros(len(problem.starts))  # steps in a row by which each pose gained little
        self.iteration = 0
        self.ended = False
        self.failure: Exception | None = None

    def take(self, ahead: Candidates) -> Tensor:
        """Keeps the poses that are better; which they are [B], none when it ends here."""
        gain = self.found.energy - ahead.energy
        won = gain > 0
        self.found = self.found.replaced(won, ahead)
        self.damping = torch.where(won, self.damping * 0.3, self.damping * 6.0).clamp(1e-5, 1e3)
        self.iteration += 1
        try:
            self.problem.watch(self.iteration, self.found)
        except Exception as error:
            self.failure = error
        self.idle = torch.where(won & (gain < self.problem.tolerance), self.idle + 1, 0.0)
        rests = torch.where(won, self.idle >= self.problem.patience, self.damping > 30.0).all()
        self.ended = bool(rests) or self.failure is not None or self.iteration == self.problem.iterations
        return torch.zeros_like(won) if self.ended else won


@dataclass(frozen=True, eq=False)
class _Batch:
    """Runs that share their steps, each with as many poses."""

    runs: list[_Run]
    objective: Objective  # the model has a row for every pose
    reference: Tensor  # [B] of every pose, which of its own request's

    @classmethod
    def of(cls, runs: list[_Run]) -> "_Batch":
        """Those of problems of one kind."""
        problems = [run.problem for run in runs]
        reference = torch.cat([problem.starts.reference for problem in problems])
        model = models_stack([problem.model[problem.starts.reference] for problem in problems])
        target = targets_joined([problem.target for problem in problems], len(problems[0].starts))
        return cls(runs, Objective(model, target, problems[0].settings), reference)

    def begin(self) -> None:
        """Energy and slopes where they start."""
        start = self._expanded(figure_concat([run.found.figure for run in self.runs]))
        shape, found = start.quadratic(), self._candidates(start)
        for run, share in self._shares():
            run.found, run.shape = found.picked(share), shape[share]

    def step(self) -> None:
        """One trial step of every pose; slopes only when some are better."""
        shape = quadratic_concat([run.shape for run in self.runs])
        step = newton_step(shape, torch.cat([run.damping for run in self.runs]))
        ahead = self._expanded(moved(figure_concat([run.found.figure for run in self.runs]), step))
        found = self._candidates(ahead)
        won = torch.cat([run.take(found.picked(share)) for run, share in self._shares()])
        if bool(won.any()):
            shape = quadratic_where(won, ahead.quadratic(), shape)
            for run, share in self._shares():
                run.shape = shape[share]

    def _expanded(self, figure: Figure) -> Expansion:
        return self.objective.expand(figure, joints=self.runs[0].problem.joints)

    def _candidates(self, expansion: Expansion) -> Candidates:
        return Candidates(expansion.figure, self.reference, expansion.energy, expansion.terms)

    def _shares(self) -> list[tuple[_Run, slice]]:
        """Which of all poses are whose."""
        each = len(self.reference) // len(self.runs)
        return [(run, slice(k * each, (k + 1) * each)) for k, run in enumerate(self.runs)]


@dataclass(frozen=True, eq=False)
class Distances:
    """The distances of several objects, each for its share of the poses."""

    objects: Sequence[SignedDistance]

    def query(self, points: Tensor) -> Tensor:
        """Points `[B, ..., 3]` [m], as many poses for each object -> `[B, ...]` [m]."""
        return torch.cat([one.query(part) for one, part in self._shares(points)])

    def tangent(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Distance `[B, ...]` [m] and gradient `[B, ..., 3]` at points `[B, ..., 3]` [m]."""
        found = [one.tangent(part) for one, part in self._shares(points)]
        return torch.cat([distance for distance, _ in found]), torch.cat([gradient for _, gradient in found])

    def _shares(self, points: Tensor) -> list[tuple[SignedDistance, Tensor]]:
        return list(zip(self.objects, points.chunk(len(self.objects)), strict=True))


def targets_joined(targets: Sequence[Target], poses: int) -> Target:
    """Several objects, with `poses` poses on each, as one target."""
    if len(targets) == 1:
        return targets[0]
    fronts = torch.stack([target.front for target in targets]).repeat_interleave(poses, dim=0)
    return replace(
        targets[0],
        latent=latent_concat([target.latent for target in targets]),
        distance=Distances([target.distance for target in targets]),
        front=fronts[:, None],
        objects=len(targets),
    )
