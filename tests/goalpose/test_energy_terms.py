import math
from dataclasses import fields

import pytest
import torch
from roam_character.rotation import quat_from_rotvec, quat_mul
from roam_goalpose.energy.angle_limit import swing_twist
from roam_goalpose.energy.contact import FLOOR, SUPPORT
from roam_goalpose.energy.expansion import expand
from roam_goalpose.energy.figure import figure_from_pose
from roam_goalpose.energy.floor import floor
from roam_goalpose.energy.penetration import penetration_depths
from roam_goalpose.energy.total import Settings, total_energy
from roam_goalpose.energy.weights import DEFAULT, EnergyWeights
from roam_goalpose.solvers.gauss_newton import moved
from roam_goalpose.solvers.search import turned_figures
from solving import model, pair, target_of

NAMES = [f.name for f in fields(EnergyWeights) if f.name != "constraint"]  # which wants wishes
SEATED = ["chair_sit", "armchair_sit", "sofa_sit", "lounge_sit", "office_sit", "stool_sit", "bench_sit", "bar_sit"]


def only(name: str) -> Settings:
    return Settings(EnergyWeights(**{n: float(n == name) for n in NAMES}), samples=2)


def shaken(name: str = "chair_sit", *, turn: float = 0.1, shift: float = 0.02, count: int = 3):
    random = torch.Generator().manual_seed(5)
    figure = model(name).figure
    joints = figure.positions.shape[1]
    turns = quat_from_rotvec(turn * torch.randn(count, joints, 3, generator=random))
    root = figure.root_position + shift * torch.randn(count, 3, generator=random)
    return figure_from_pose(figure.skeleton, root, quat_mul(figure.rotations.expand(count, -1, -1), turns))


@pytest.mark.parametrize("term", [n for n in NAMES if n != "angle_limit"])
def test_no_term_objects_to_the_reference_on_its_own_object(term):
    energy, _ = total_energy(model("chair_sit").figure, model("chair_sit"), target_of("chair_sit"), only(term))
    missing = 1 - float(model("chair_sit").contacts.weight.sum()) if term == "contact" else 0.0
    assert float(energy) == pytest.approx(missing, abs=0.02)  # the grid rounds edges off


@pytest.mark.parametrize("term", ["descriptor", "prior", "contact", "clearance", "facing", "gravity"])
def test_terms_grow_when_the_pose_is_shaken(term):
    still, _ = total_energy(model("chair_sit").figure, model("chair_sit"), target_of("chair_sit"), only(term))
    wrong, _ = total_energy(shaken(), model("chair_sit"), target_of("chair_sit"), only(term))
    assert (wrong > still + 1e-3).all()


@pytest.mark.parametrize("term", NAMES)
def test_closed_form_gradients_equal_those_of_autograd(term):
    figure, target = shaken(turn=0.2, shift=0.05), target_of("chair_sit")
    step = torch.zeros(len(figure), 3 + 3 * figure.positions.shape[1], requires_grad=True)
    energy, _ = total_energy(moved(figure, step), model("chair_sit"), target, only(term))
    (gradient,) = torch.autograd.grad(energy.sum(), step)
    found = expand(figure, model("chair_sit"), target, only(term))
    if term == "self_collision":  # the expansion looks at the deepest pairs only
        assert (found.energy <= energy + 1e-6).all()
        return
    torch.testing.assert_close(found.energy, energy.detach(), atol=1e-6, rtol=1e-4)
    torch.testing.assert_close(found.quadratic().gradient, gradient, atol=2e-5, rtol=1e-3)


def test_floor_energy_sums_squared_depths_in_metres():
    figure = model("chair_sit").figure
    lowest = float(figure.positions[..., 1].min())
    depths = (lowest + 0.05 - figure.positions[0, :, 1]).clamp(min=0.0)
    assert float(floor(figure.positions[..., 1] - lowest - 0.05).energy) == pytest.approx(
        float(depths.square().sum()), rel=1e-5
    )


def test_lifting_the_body_off_the_seat_costs_contacts_and_lowering_it_penetration():
    figure, m, target = model("chair_sit").figure, model("chair_sit"), target_of("chair_sit")
    lift = torch.zeros(2, 3 + 3 * figure.positions.shape[1])
    lift[0, 1], lift[1, 1] = 0.06, -0.06
    both = moved(figure[torch.tensor([0, 0])], lift)
    _, terms = total_energy(both, m, target, Settings(DEFAULT, 2))
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
    bent, _ = total_energy(backwards, m, target_of("chair_sit"), only("angle_limit"))
    fine, _ = total_energy(m.figure, m, target_of("chair_sit"), only("angle_limit"))
    assert float(bent) > float(fine) + 0.005


@pytest.mark.parametrize("name", SEATED)
def test_reference_people_touch_seat_and_floor_without_sinking_in(name):
    m = model(name)
    assert float(penetration_depths(m.figure, m.body, pair(name).shape.distance).max()) < 0.04
    assert (m.contacts.group == SUPPORT).any()
    assert (m.contacts.group == FLOOR).any() == (name != "bar_sit")
    assert 0.10 < float(m.hip_height) < 0.18


def test_turning_a_figure_turns_its_heading_and_keeps_its_height():
    turned = turned_figures(model("chair_sit").figure, torch.tensor([math.pi / 2]))
    toes = turned.skeleton.index("leftToes")
    before = model("chair_sit").figure.positions[0, toes] - model("chair_sit").figure.root_position[0]
    after = turned.positions[0, toes] - turned.root_position[0]
    torch.testing.assert_close(after, torch.stack([before[2], before[1], -before[0]]), atol=1e-5, rtol=0)
