"""The published schedule (supplement C): 250 rigid, 100 joint and 150 regularised Adam steps from the paper's initial
pose.

Our changes (docs/concepts/method.md): metres instead of millimetres and boxes, several initial headings in one batch,
the best iterate instead of the last, no gradients for the network.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.objective import Objective
from roam_goalpose.energy.reference import ReferenceModel
from roam_goalpose.energy.scene import Settings, Target
from roam_goalpose.energy.terms import published_weights
from roam_goalpose.objects import Shape
from roam_goalpose.solvers.adam import Schedule, descend
from roam_goalpose.solvers.candidates import Candidates
from roam_goalpose.solvers.progress import Progress, Watch
from roam_goalpose.solvers.search import headings, turned_figures

COLUMN = 0.1  # [m] the hip goes onto a surface point within this of it in x and z


@dataclass(frozen=True)
class PaperConfig:
    """Sizes of the published run; `headings` initial poses are optimised side by side."""

    samples: int = 50  # probes per centre
    headings: int = 1
    scale: float = 1.0  # share of the published iterations, for tests

    def stages(self) -> list[tuple[int, Schedule, Settings]]:
        """Stage number, Adam schedule and energy of the three stages."""
        counts = [max(1, round(self.scale * n)) for n in (250, 100, 150)]
        rigid = Schedule(counts[0], 1e-3, 0.01, joints=False)
        free, final = Schedule(counts[1], 1e-3, 0.01, joints=True), Schedule(counts[2], 1e-3, 0.01, joints=True)
        every = published_weights()
        alone = every.only("descriptor")
        return [
            (1, rigid, Settings(alone, self.samples, knee_weight=3.0, by_nearness=False)),
            (2, free, Settings(alone, self.samples, by_nearness=False)),
            (3, final, Settings(every, self.samples, by_nearness=False)),
        ]


def initial_figure(model: ReferenceModel, shape: Shape, turns: Tensor) -> Figure:
    """The reference over the target's middle, turned, the hip on the surface point nearest to it in its column."""
    points = torch.as_tensor(shape.points)
    middle = torch.as_tensor(shape.bounds.mean(0), dtype=torch.float32)
    hip = model.figure.root_position[0].clone()
    hip = torch.stack([middle[0], hip[1] - model.floor_height[0] + shape.floor_height, middle[2]])
    column = points[((points - hip)[:, [0, 2]].abs() < COLUMN).all(-1)]
    above = column[column[:, 1] >= hip[1]]
    chosen = above if len(above) else column
    if len(chosen):
        hip = chosen[(chosen - hip).norm(dim=-1).argmin()]
    moved = hip - model.figure.root_position[0]
    figure = model.figure
    at_hip = Figure(figure.skeleton, hip[None], figure.rotations, figure.positions + moved, figure.orientations)
    return turned_figures(at_hip[torch.zeros(len(turns), dtype=torch.long)], turns)


def solve_paper(
    model: ReferenceModel, target: Target, shape: Shape, config: PaperConfig, *, initial_yaw: float, watch: Watch
) -> Candidates:
    """The three published stages from `config.headings` initial headings; best first."""
    figure = initial_figure(model, shape, headings(config.headings, initial_yaw))
    stages = config.stages()
    total, done = sum(schedule.iterations for _, schedule, _ in stages), 0
    found: Candidates | None = None
    for stage, schedule, settings in stages:

        def report(iteration: int, now: Candidates, stage: int = stage, done: int = done) -> None:
            best = int(torch.argmin(now.energy))
            watch.tell(lambda: Progress(stage, done + iteration, total, float(now.energy[best]), now.pose(best)))

        found = descend(figure, Objective(model, target, settings), schedule, watch=report)
        figure, done = found.figure, done + schedule.iterations
    assert found is not None
    return found.ranked()
