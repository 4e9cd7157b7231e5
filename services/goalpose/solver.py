"""The default solver: a coarse rigid search, then Gauss-Newton on ever fewer survivors with the whole energy."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from torch import Tensor

from goalpose.candidates import Candidates, distinct
from goalpose.energy.total import ReferenceModel, Settings, Target
from goalpose.energy.weights import DEFAULT, EnergyWeights
from goalpose.newton import minimise
from goalpose.progress import Progress, Watch
from goalpose.search import coarse_search, headings


@dataclass(frozen=True)
class Round:
    """One stage: how many candidates go in, how long, with how many probes per centre."""

    keep: int
    iterations: int
    samples: int
    joints: bool


RIGID = Round(keep=8, iterations=4, samples=1, joints=False)
JOINTS = Round(keep=5, iterations=5, samples=1, joints=True)
FINISH = Round(keep=2, iterations=10, samples=3, joints=True)


@dataclass(frozen=True, kw_only=True)
class SolverConfig:
    """Sizes of the search; the defaults are what evaluation settled on."""

    weights: EnergyWeights = DEFAULT
    headings: int = 24
    survey_headings: int = 12  # when references are to be compared
    survey_places: int = 70
    shortlist: int = 48  # placements that geometry passes on to the descriptor
    contenders: int = 6  # references that are tried before one is chosen
    coarse_samples: int = 1  # probes per centre
    rigid: Round = RIGID
    joints: Round = JOINTS
    finish: Round = FINISH

    @property
    def samples(self) -> int:
        """Probes per centre that a reference model needs."""
        return max(self.coarse_samples, self.rigid.samples, self.joints.samples, self.finish.samples)

    @property
    def iterations(self) -> int:
        """Steps in all."""
        return self.rigid.iterations + self.joints.iterations + self.finish.iterations


def start_placements(
    model: ReferenceModel, target: Target, config: SolverConfig, *, places: Tensor, initial_yaw: float, keep: int = 0
) -> Candidates:
    """The coarse search of one reference: the placements worth optimising, best first."""
    settings = Settings(config.weights, config.coarse_samples)
    turns = headings(config.headings, initial_yaw)
    return coarse_search(
        model, target, settings, places=places, turns=turns, shortlist=config.shortlist, keep=keep or config.rigid.keep
    )


def survey(
    model: ReferenceModel, target: Target, config: SolverConfig, *, places: Tensor, initial_yaw: float
) -> Candidates:
    """A coarser and cheaper `start_placements`, to compare references."""
    every = -(-len(places) // config.survey_places)
    rough = replace(config, headings=config.survey_headings, shortlist=config.shortlist // 3)
    return start_placements(model, target, rough, places=places[::every], initial_yaw=initial_yaw, keep=2)


def best_after_trial(starts: Candidates, model: ReferenceModel, target: Target, config: SolverConfig) -> float:
    """The fit that the better of two surveyed placements reaches in a few steps: what references are compared by."""
    tried = starts.figure
    settings = Settings(config.weights, config.joints.samples)
    for joints in (False, True):
        found = minimise(tried, model, target, settings, iterations=3, joints=joints)
        tried = found.figure
    return reference_fit(found.ranked())


def reference_fit(ranked: Candidates) -> float:
    """Energy of the best candidate with the descriptor at half its weight.

    Descriptor residuals order the placements of one reference better than references: around a bare bench descriptors
    are blander than around an armchair, and smaller residuals say less of a better fit.
    """
    descriptor = ranked.terms.get("descriptor")
    return float(ranked.energy[0] if descriptor is None else ranked.energy[0] - 0.5 * descriptor[0])


def refine(starts: Candidates, model: ReferenceModel, target: Target, config: SolverConfig, watch: Watch) -> Candidates:
    """Root, then all joints, then all joints of the finalists; best first."""
    found, done = starts, 0
    for stage, turn in ((1, config.rigid), (2, config.joints), (3, config.finish)):
        if stage > 1:
            found = found.picked(distinct(found, turn.keep))
        found = minimise(
            found.figure,
            model,
            target,
            Settings(config.weights, turn.samples),
            iterations=turn.iterations,
            joints=turn.joints,
            watch=_reporter(watch, stage, done, config),
        )
        done += turn.iterations
    return found.ranked()


def _reporter(watch: Watch, stage: int, done: int, config: SolverConfig) -> Callable[[int, Candidates], None]:
    def report(iteration: int, found: Candidates) -> None:
        best = int(found.energy.argmin())
        watch.tell(
            lambda: Progress(stage, done + iteration, config.iterations, float(found.energy[best]), found.pose(best))
        )

    return report
