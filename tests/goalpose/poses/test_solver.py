import math

import pytest
import torch
from roam_goalpose.energy.reference import ReferenceModel
from roam_goalpose.energy.scene import Settings, Target
from roam_goalpose.energy.terms import default_weights
from roam_goalpose.references.legs import settle_legs
from roam_goalpose.solvers.candidates import Candidates, facing_yaw
from roam_goalpose.solvers.gauss_newton import Problem, minimise
from roam_goalpose.solvers.paper import PaperConfig, solve_paper
from roam_goalpose.solvers.progress import Cancelled, Watch
from roam_goalpose.solvers.search import evaluate, find_places, placed_figures
from roam_goalpose.solvers.staged import SolverConfig, solve
from solving import model, pair, target_of


def solved(reference: str, furniture: str, *, first_yaw: float = 0.0, watch: Watch | None = None):
    places = find_places(pair(furniture).shape)
    return solve(
        model(reference, 3),
        target_of(furniture),
        SolverConfig(),
        places=places,
        first_yaw=first_yaw,
        watch=watch or Watch(),
    )


def as_candidates(m: ReferenceModel, target: Target) -> Candidates:
    """The reference pose itself, to start from."""
    return evaluate(m.figure, torch.zeros(1, dtype=torch.long), m, target, Settings(default_weights(), 1))


def problem(m: ReferenceModel, target: Target, *, iterations: int = 3, joints: bool = True, **more) -> Problem:
    settings = Settings(default_weights(), 1)
    starts = as_candidates(m, target)
    return Problem(
        starts=starts, model=m, target=target, settings=settings, iterations=iterations, joints=joints, **more
    )


def test_places_lie_on_top_of_the_seat():
    places = find_places(pair("stool_sit").shape)
    assert len(places) > 10
    assert (places[:, 1] - 0.45).abs().max() < 0.03


@pytest.mark.parametrize("first_yaw", [0.0, 2.0])
def test_the_reference_is_found_again_on_its_own_object(first_yaw):
    found = solved("chair_sit", "chair_sit", first_yaw=first_yaw)
    off = (found.figure.positions[0] - model("chair_sit").figure.positions[0]).norm(dim=-1)
    assert float(off.max()) < 0.03


def test_a_dining_chair_pose_fits_an_office_chair():
    found = solved("chair_sit", "office_sit")
    seat = 0.46
    hip_height = float(model("chair_sit").hip_height)
    assert float(found.figure.root_position[0, 1]) - seat == pytest.approx(hip_height, abs=0.03)
    assert abs(float(facing_yaw(found.figure)[0])) < math.radians(15)


def test_newton_never_raises_the_energy():
    m, target = model("chair_sit", 3), target_of("office_sit")
    energies: list[float] = []
    minimise(problem(m, target, iterations=6, watch=lambda i, c: energies.append(float(c.energy[0]))))
    assert energies == sorted(energies, reverse=True)
    assert energies[-1] < energies[0]


def test_root_stage_leaves_the_joints_alone():
    m = model("chair_sit", 3)
    target = target_of("office_sit")
    found = minimise(problem(m, target, joints=False))
    torch.testing.assert_close(found.figure.rotations[:, 1:], m.figure.rotations[:, 1:], atol=1e-6, rtol=0)


def test_low_and_high_seats_keep_the_feet_on_the_floor_or_hanging():
    m = model("chair_sit", 3)
    places = torch.tensor([[0.0, 0.30, 0.0], [0.0, 0.75, 0.0]])
    ankles = placed_figures(m, places, 0.0).positions[:, m.skeleton.index("leftFoot"), 1]
    standing = float(m.figure.positions[0, m.skeleton.index("leftFoot"), 1])
    assert float(ankles[0]) == pytest.approx(standing, abs=0.01)
    assert 0.25 < float(ankles[1]) < 0.5


def test_settled_legs_keep_the_feet_flat():
    m = model("chair_sit", 3)
    foot = m.skeleton.index("leftFoot")
    settled = settle_legs(m.figure, -0.05, ankle_height=0.08)
    torch.testing.assert_close(settled.orientations[0, foot], m.figure.orientations[0, foot], atol=1e-4, rtol=0)


def test_progress_counts_up_and_ends_with_the_best_energy():
    told = []
    found = solved("chair_sit", "chair_sit", watch=Watch(told.append))
    assert [p.stage for p in told] == sorted(p.stage for p in told)
    assert told[-1].energy == pytest.approx(float(found.energy[0]), rel=1e-5)
    assert told[-1].pose is not None


def test_cancelling_stops_the_solver():
    with pytest.raises(Cancelled):
        solved("chair_sit", "chair_sit", watch=Watch(cancelled=lambda: True))


def test_the_published_schedule_lowers_the_descriptor_energy():
    m, target = model("chair_sit", 3), target_of("office_sit")
    energies: list[float] = []
    watch = Watch(lambda p: energies.append(p.energy) if p.stage == 1 else None)
    config = PaperConfig(samples=2, headings=2, scale=0.1)
    found = solve_paper(m, target, pair("office_sit").shape, config, initial_yaw=0.3, watch=watch)
    assert len(found) == 2
    assert energies[-1] < energies[0]
