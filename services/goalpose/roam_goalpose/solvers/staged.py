"""The default solver: a coarse rigid search over all references, then Gauss-Newton on ever fewer survivors.

Candidates made from different references are optimised side by side in one batch: which reference fits an object best
shows only once its pose has been adapted a little.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from torch import Tensor

from roam_goalpose.energy.body import penetration_depths
from roam_goalpose.energy.reference import ReferenceModel
from roam_goalpose.energy.scene import Settings, Target
from roam_goalpose.energy.terms import default_weights
from roam_goalpose.energy.weights import EnergyWeights
from roam_goalpose.solvers.candidates import Candidates, distinct
from roam_goalpose.solvers.gauss_newton import Problem, minimise
from roam_goalpose.solvers.progress import Progress, Watch
from roam_goalpose.solvers.search import coarse_search, headings


@dataclass(frozen=True)
class Round:
    """One stage: how many candidates go in, how many of any one reference, how long, with how many probes a centre."""

    keep: int
    each: int  # when there are several references to choose from
    iterations: int
    samples: int
    joints: bool
    apart: float = 0.12  # [m] placements nearer than this to a better one, with about its heading, are the same
    tolerance: float = 1e-4  # of energy: no candidate gains more in a step, and the stage ends ...
    patience: int = 1  # ... when that happens as often in a row

    def wanting(self, count: int) -> "Round":
        """The same with at least `count` candidates, whatever references they are made from."""
        return replace(self, keep=max(self.keep, count), each=max(self.each, count))


RIGID = Round(keep=14, each=2, iterations=3, samples=1, joints=False)
JOINTS = Round(keep=8, each=1, iterations=6, samples=1, joints=True)
FINISH = Round(keep=2, each=2, iterations=8, samples=3, joints=True)
# Until it rests: what is left of the way is what two uploads of one object, turned and rounded, can differ by.
POLISH = Round(keep=1, each=1, iterations=16, samples=3, joints=True, tolerance=1e-5, patience=2)


@dataclass(frozen=True, kw_only=True)
class SolverConfig:
    """Sizes of the search; the defaults are what evaluation settled on."""

    weights: EnergyWeights = field(default_factory=default_weights)
    headings: int = 16
    shortlist: int = 48  # placements that geometry passes on to the descriptor, of all references together
    coarse_samples: int = 1  # probes per centre
    rigid: Round = RIGID
    joints: Round = JOINTS
    finish: Round = FINISH
    polish: Round = POLISH

    def wanting(self, count: int) -> "SolverConfig":
        """Sizes for several poses: as many more candidates as there are more poses to find."""
        if count <= 1:
            return self
        return replace(
            self,
            shortlist=max(self.shortlist, 24 * count),
            rigid=self.rigid.wanting(6 * count),
            joints=self.joints.wanting(4 * count),
            finish=replace(self.finish.wanting(2 * count), apart=0.25),
            polish=replace(self.polish.wanting(2 * count), apart=0.25),
        )

    @property
    def samples(self) -> int:
        """Probes per centre that a reference model needs."""
        return max(
            self.coarse_samples, self.rigid.samples, self.joints.samples, self.finish.samples, self.polish.samples
        )

    @property
    def iterations(self) -> int:
        """Steps in all."""
        return sum(turn.iterations for turn in (self.rigid, self.joints, self.finish, self.polish))


def solve(
    model: ReferenceModel,
    target: Target,
    config: SolverConfig,
    *,
    places: Tensor,
    first_yaw: float,
    watch: Watch,
    keep: int = 0,
    steps: Callable[[Problem], Candidates] = minimise,
) -> Candidates:
    """Poses on the target, best first: those that were optimised to the end.

    `places` [K, 3] where hips may rest [m], `first_yaw` the heading from which the search goes round [rad], `keep`
    placements to optimise (0: as the configuration says), `steps` what solves each stage: alone, or shared.
    """
    found = coarse_search(
        model,
        target.rigid,
        Settings(config.weights, config.coarse_samples),
        places=places,
        turns=headings(config.headings, first_yaw),
        shortlist=max(6, config.shortlist // len(model)),
        apart=0.5 * config.rigid.apart,
        watch=watch,
    )
    done = 0
    for stage, turn in ((1, config.rigid), (2, config.joints), (3, config.finish), (3, config.polish)):
        watch.check()
        each = turn.each if len(model) > 1 else None
        count = keep if keep and stage == 1 else turn.keep
        found = found.picked(distinct(found, count, reach=turn.apart, each=each))
        problem = Problem(
            starts=found,
            model=model,
            target=target if turn.joints else target.rigid,
            settings=Settings(config.weights, turn.samples),
            iterations=turn.iterations,
            joints=turn.joints,
            tolerance=turn.tolerance,
            patience=turn.patience,
            watch=_reporter(watch, stage, done, config),
        )
        found = steps(problem)
        depths = penetration_depths(found.figure, model.body, target.distance)
        found = replace(found, deepest=depths.amax(-1))
        done += turn.iterations
    return found.ranked()


def _reporter(watch: Watch, stage: int, done: int, config: SolverConfig) -> Callable[[int, Candidates], None]:
    def report(iteration: int, found: Candidates) -> None:
        best = int(found.energy.argmin())
        watch.tell(
            lambda: Progress(stage, done + iteration, config.iterations, float(found.energy[best]), found.pose(best))
        )

    return report
