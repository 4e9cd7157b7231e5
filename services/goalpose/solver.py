"""The default solver: a coarse rigid search, then few Adam steps on ever fewer survivors with the whole energy."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from goalpose.candidates import Candidates, distinct
from goalpose.descent import Schedule, descend
from goalpose.energy.figure import Figure
from goalpose.energy.total import ReferenceModel, Settings, Target, total_energy
from goalpose.energy.weights import DEFAULT, EnergyWeights
from goalpose.progress import Progress, Watch
from goalpose.search import coarse_search, evaluate, headings


@dataclass(frozen=True, kw_only=True)
class SolverConfig:
    """Sizes of the search; the defaults are what evaluation settled on."""

    weights: EnergyWeights = DEFAULT
    headings: int = 24
    shortlist: int = 96  # placements that geometry passes on to the descriptor
    starts: int = 10  # placements that are optimised
    finalists: int = 3
    rigid: Schedule = Schedule(20, 0.008, 0.04, joints=False, decay=0.3)
    joints: Schedule = Schedule(30, 0.006, 0.03, joints=True, decay=0.5)
    finish: Schedule = Schedule(50, 0.004, 0.02, joints=True, decay=0.1)
    coarse_samples: int = 2  # probes per centre
    samples: int = 4

    @property
    def iterations(self) -> int:
        """Adam steps in all."""
        return self.rigid.iterations + self.joints.iterations + self.finish.iterations


def start_placements(
    model: ReferenceModel, target: Target, config: SolverConfig, *, places: Tensor, initial_yaw: float
) -> Candidates:
    """The coarse search of one reference: the placements worth optimising, best first."""
    settings = Settings(config.weights, config.coarse_samples)
    turns = headings(config.headings, initial_yaw)
    return coarse_search(
        model, target, settings, places=places, turns=turns, shortlist=config.shortlist, keep=config.starts
    )


def refine(starts: Candidates, model: ReferenceModel, target: Target, config: SolverConfig, watch: Watch) -> Candidates:
    """Root, then all joints, then all joints of the finalists; best first."""
    done = 0
    found = starts
    for stage, schedule in ((1, config.rigid), (2, config.joints), (3, config.finish)):
        fine = stage == 3
        settings = Settings(config.weights, config.samples if fine else config.coarse_samples)
        if fine:
            found = found.picked(distinct(found, config.finalists))
        found = descend(
            found.figure, _objective(model, target, settings), schedule, watch=_reporter(watch, stage, done, config)
        )
        done += schedule.iterations
    return evaluate(found.figure, model, target, replace(settings, samples=config.samples)).ranked()


def _objective(
    model: ReferenceModel, target: Target, settings: Settings
) -> Callable[[Figure], tuple[Tensor, dict[str, Tensor]]]:
    return lambda figure: total_energy(figure, model, target, settings)


def _reporter(watch: Watch, stage: int, done: int, config: SolverConfig) -> Callable[[int, Candidates], None]:
    def report(iteration: int, found: Candidates) -> None:
        best = int(torch.argmin(found.energy))
        watch.tell(
            lambda: Progress(stage, done + iteration, config.iterations, float(found.energy[best]), found.pose(best))
        )

    return report
