"""Every term of the registry, whichever there are: its value, its Jacobian, and what it thinks of its own reference."""

import math

import pytest
import torch
from roam_character.rotation import quat_from_rotvec, quat_mul
from roam_goalpose.energy.body import penetration_depths
from roam_goalpose.energy.constraints import Constraints
from roam_goalpose.energy.figure import figure_from_pose
from roam_goalpose.energy.objective import Objective
from roam_goalpose.energy.scene import Settings, Target
from roam_goalpose.energy.terms import TERMS, default_weights, published_weights
from roam_goalpose.energy.terms.angle_limit import swing_twist
from roam_goalpose.energy.terms.contact import FLOOR, SUPPORT, contacts_of
from roam_goalpose.energy.weights import EnergyWeights
from roam_goalpose.solvers.gauss_newton import moved
from roam_goalpose.solvers.search import turned_figures
from solving import model, pair, target_of

NAMES = list(TERMS)
SEATED = ["chair_sit", "armchair_sit", "sofa_sit", "lounge_sit", "office_sit", "stool_sit", "bench_sit", "bar_sit"]
WISHES = Constraints(seat_point=(0.05, 0.4, 0.02), facing=0.3, hands=(("left", (0.3, 0.7, 0.2)),))


def only(name: str) -> EnergyWeights:
    return EnergyWeights.of({name: 1.0})


def objective(name: str, reference: str = "chair_sit", target: Target | None = None) -> Objective:
    """One term alone, on the reference's own object; the wishes are for the term that wants some."""
    wished = target or target_of(reference, WISHES if name == "constraint" else None)
    return Objective(model(reference), wished, Settings(only(name), samples=2))


def shaken(name: str = "chair_sit", *, turn: float = 0.1, shift: float = 0.02, count: int = 3):
    generator = torch.Generator().manual_seed(5)
    figure = model(name).figure
    joints = figure.positions.shape[1]
    turns = quat_from_rotvec(turn * torch.randn(count, joints, 3, generator=generator))
    root = figure.root_position + shift * torch.randn(count, 3, generator=generator)
    return figure_from_pose(figure.skeleton, root, quat_mul(figure.rotations.expand(count, -1, -1), turns))


def violating():
    """Poses so far off that every term has something to say: below the floor, arms in the trunk, legs stretched."""
    figure = shaken(turn=0.5, shift=0.15, count=4)
    rotations = figure.rotations.clone()
    rotations[:, figure.skeleton.indices(["leftLowerLeg", "rightLowerLeg"])] = torch.tensor([0.0, 0.0, 0.0, 1.0])
    lower = figure.root_position - torch.tensor([0.0, 0.15, 0.0])
    return figure_from_pose(figure.skeleton, lower, rotations)


@pytest.mark.parametrize("term", [n for n in NAMES if n not in ("angle_limit", "constraint")])
def test_no_term_objects_to_the_reference_on_its_own_object(term):
    energy = objective(term).at(model("chair_sit").figure).energy
    missing = 1 - float(contacts_of(model("chair_sit")).weight.sum()) if term == "contact" else 0.0
    assert float(energy) == pytest.approx(missing, abs=0.02)  # the grid rounds edges off


@pytest.mark.parametrize("term", NAMES)
def test_every_term_objects_to_a_pose_that_is_far_off(term):
    still = objective(term).at(model("chair_sit").figure).energy
    assert (objective(term).at(violating()).energy > still + 1e-4).any()


@pytest.mark.parametrize("term", NAMES)
def test_a_term_has_the_same_value_in_every_solver(term):
    for figure in (shaken(), shaken(turn=0.2, shift=0.05), violating()):
        searched, expanded = objective(term).at(figure).energy, objective(term).expand(figure).energy
        torch.testing.assert_close(searched, expanded, atol=1e-6, rtol=1e-6)


@pytest.mark.parametrize("joints", [True, False])
def test_all_terms_together_have_the_same_value_in_every_solver(joints):
    every = Objective(model("chair_sit"), target_of("chair_sit", WISHES), Settings(default_weights(), 2))
    searched, expanded = every.at(shaken()), every.expand(shaken(), joints=joints)
    assert list(searched.terms) == list(expanded.terms) == NAMES
    torch.testing.assert_close(searched.energy, expanded.energy, atol=1e-5, rtol=1e-6)


@pytest.mark.parametrize("term", NAMES)
def test_gradients_equal_those_of_autograd(term):
    figure = shaken(turn=0.3, shift=0.05)
    step = torch.zeros(len(figure), 3 + 3 * figure.positions.shape[1], requires_grad=True)
    (expected,) = torch.autograd.grad(objective(term).at(moved(figure, step)).energy.sum(), step)
    found = objective(term).expand(figure).quadratic().gradient
    torch.testing.assert_close(found, expected, atol=2e-5, rtol=1e-3)


@pytest.mark.parametrize("term", NAMES)
def test_gradients_equal_finite_differences_along_random_steps(term):
    figure, width = shaken(turn=0.3, shift=0.05), 1e-3
    generator = torch.Generator().manual_seed(3)
    gradient = objective(term).expand(figure).quadratic().gradient
    for _ in range(8):
        way = torch.nn.functional.normalize(torch.randn(gradient.shape, generator=generator), dim=-1)
        ahead = objective(term).expand(moved(figure, width * way)).energy.double()
        behind = objective(term).expand(moved(figure, -width * way)).energy.double()
        slope = (gradient * way).sum(-1).double()
        torch.testing.assert_close((ahead - behind) / (2 * width), slope, atol=1e-2, rtol=0.05)


@pytest.mark.parametrize("term", [n for n in NAMES if TERMS[n].internal])
def test_internal_terms_do_not_change_with_the_root(term):
    figure = violating()
    away = torch.zeros(len(figure), 6)
    away[:, 1], away[:, 4] = 0.3, 0.2
    before, after = objective(term).at(figure).energy, objective(term).at(moved(figure, away)).energy
    torch.testing.assert_close(before, after, atol=1e-4, rtol=1e-3)


def test_the_papers_weights_are_its_own():
    assert dict(published_weights().pairs) == {"descriptor": 1.0, "angle_limit": 3.283, "floor": 0.01, "prior": 0.01}


def test_weights_say_which_terms_there_are():
    unknown = Settings(EnergyWeights.of({"comfort": 1.0}), samples=2)
    with pytest.raises(ValueError, match="comfort; there are descriptor"):
        Objective(model("chair_sit"), target_of("chair_sit"), unknown).at(shaken())
    with pytest.raises(ValueError, match="all weights are 0"):
        Objective(model("chair_sit"), target_of("chair_sit"), Settings(EnergyWeights(), samples=2)).at(shaken())


def test_floor_energy_sums_squared_depths_in_metres():
    figure, target = model("chair_sit").figure, target_of("chair_sit")
    lowest = float(figure.positions[..., 1].min())
    depths = (lowest + 0.05 - figure.positions[0, :, 1]).clamp(min=0.0)
    higher = Target(target.field, target.latent, target.distance, lowest + 0.05, target.front)
    found = objective("floor", target=higher).at(figure).energy
    assert float(found) == pytest.approx(float(depths.square().sum()), rel=1e-5)


def test_lifting_the_body_off_the_seat_costs_contacts_and_lowering_it_penetration():
    figure = model("chair_sit").figure
    lift = torch.zeros(2, 3 + 3 * figure.positions.shape[1])
    lift[0, 1], lift[1, 1] = 0.06, -0.06
    both = moved(figure[torch.tensor([0, 0])], lift)
    terms = Objective(model("chair_sit"), target_of("chair_sit"), Settings(default_weights(), 2)).at(both).terms
    assert float(terms["contact"][0]) > 0.1
    assert float(terms["penetration"][1]) > 0.05 > float(terms["penetration"][0])


def test_swing_and_twist_of_a_pure_rotation():
    about_bone = quat_from_rotvec(torch.tensor([[0.0, -0.7, 0.0]]))
    across = quat_from_rotvec(torch.tensor([[0.4, 0.0, 0.0]]))
    axis = torch.tensor([1])
    torch.testing.assert_close(swing_twist(about_bone, axis), torch.tensor([[0.0, -0.7, 0.0]]), atol=1e-5, rtol=0)
    torch.testing.assert_close(swing_twist(across, axis), torch.tensor([[0.4, 0.0, 0.0]]), atol=1e-5, rtol=0)


def test_knees_that_bend_backwards_exceed_their_limits():
    m = model("chair_sit")
    knee = m.skeleton.index("leftLowerLeg")
    rotations = m.figure.rotations.clone()
    rotations[0, knee] = quat_from_rotvec(torch.tensor([-0.6, 0.0, 0.0]))
    backwards = figure_from_pose(m.skeleton, m.figure.root_position, rotations)
    bent, fine = (objective("angle_limit").at(figure).energy for figure in (backwards, m.figure))
    assert float(bent) > float(fine) + 0.005


@pytest.mark.parametrize("name", SEATED)
def test_reference_people_touch_seat_and_floor_without_sinking_in(name):
    m = model(name)
    contacts = contacts_of(m)
    assert float(penetration_depths(m.figure, m.body, pair(name).shape.distance).max()) < 0.04
    assert (contacts.group == SUPPORT).any()
    assert (contacts.group == FLOOR).any() == (name != "bar_sit")
    assert 0.10 < float(m.hip_height) < 0.18


def test_turning_a_figure_turns_its_heading_and_keeps_its_height():
    turned = turned_figures(model("chair_sit").figure, torch.tensor([math.pi / 2]))
    toes = turned.skeleton.index("leftToes")
    before = model("chair_sit").figure.positions[0, toes] - model("chair_sit").figure.root_position[0]
    after = turned.positions[0, toes] - turned.root_position[0]
    torch.testing.assert_close(after, torch.stack([before[2], before[1], -before[0]]), atol=1e-5, rtol=0)


def pitched(name: str, degrees: float):
    """A reference pose whose whole trunk leans back further, legs as they are."""
    figure = model(name).figure
    turn = quat_from_rotvec(torch.tensor([-math.radians(degrees), 0.0, 0.0]))
    rotations = figure.rotations.clone()
    rotations[:, 0] = quat_mul(turn, rotations[:, 0])
    return figure_from_pose(figure.skeleton, figure.root_position, rotations)


def test_leaning_back_costs_where_nothing_is_behind():
    on_stool = [float(objective("unsupported_lean", "stool_sit").at(pitched("stool_sit", a)).energy) for a in (0, 20)]
    assert on_stool[0] < 0.01
    assert on_stool[1] > 0.5
    assert float(objective("unsupported_lean").at(model("chair_sit").figure).energy) < 0.01
    assert float(objective("unsupported_lean", "sofa_lie").at(pitched("sofa_lie", 20)).energy) == 0.0


def test_feet_that_nobody_could_rise_from_cost():
    m = model("chair_sit")
    rotations = m.figure.rotations.clone()
    for bone in ("leftLowerLeg", "rightLowerLeg"):
        knee = m.skeleton.index(bone)
        rotations[0, knee] = quat_mul(rotations[0, knee], quat_from_rotvec(torch.tensor([-0.7, 0.0, 0.0])))
    ahead = figure_from_pose(m.skeleton, m.figure.root_position, rotations)
    assert float(objective("feet_ahead").at(m.figure).energy) < 0.05
    assert float(objective("feet_ahead").at(ahead).energy) > 0.5
    assert float(objective("feet_ahead", "bar_sit").at(model("bar_sit").figure).energy) == 0.0
