"""What callers ask for besides a good pose."""

import math

import pytest
import torch
from roam_goalpose.energy.chain import Chain
from roam_goalpose.energy.constraints import NONE, Constraints, constraints_in
from roam_goalpose.energy.term import squares
from roam_goalpose.energy.terms.constraint import NEAR, constraint_misses, constraint_motion
from roam_goalpose.objects.own_axes import Placement
from roam_goalpose.solvers.candidates import facing_yaw
from roam_goalpose.solvers.gauss_newton import moved
from roam_goalpose.solvers.search import turned_figures
from solving import model, pair

ALL = Constraints(
    seat_point=(0.1, 0.2, 0.3), facing=0.4, hands=(("left", (0.4, 0.8, 0.1)), ("right", (-0.4, 0.9, 0.2)))
)


def seated(yaw=0.0):
    return turned_figures(model("chair_sit").figure, torch.tensor([yaw]))


def test_nothing_is_asked_by_default():
    assert not NONE.given
    assert ALL.given
    assert ALL.rigid == Constraints(seat_point=(0.1, 0.2, 0.3), facing=0.4)


def test_a_person_over_the_point_who_faces_the_way_has_met_the_wish():
    figure = seated(0.7)
    x, _, z = figure.root_position[0].tolist()
    wish = Constraints(seat_point=(x, -5.0, z), facing=float(facing_yaw(figure)))
    assert constraint_misses(figure, wish).abs().max() < 1e-4
    aside = Constraints(seat_point=(x + NEAR, 0.0, z))
    assert float(squares(constraint_misses(figure, aside)).energy) == pytest.approx(1.0, abs=1e-4)


def test_a_lying_person_faces_where_their_left_side_says():
    figure = turned_figures(model("sofa_lie").figure, torch.tensor([1.1]))
    wish = Constraints(facing=float(facing_yaw(figure)))
    assert constraint_misses(figure, wish)[:, [0, 2]].abs().max() < 0.6  # hips tilt a little; a turn costs far more
    assert float(squares(constraint_misses(figure, Constraints(facing=wish.facing + math.pi))).energy) > 90


def test_motion_is_the_derivative_of_the_misses():
    figure = seated(0.3)
    step = torch.zeros(1, 3 + 3 * figure.positions.shape[1], requires_grad=True)
    expected = torch.autograd.functional.jacobian(lambda s: constraint_misses(moved(figure, s), ALL)[0], step)[:, 0]
    torch.testing.assert_close(constraint_motion(Chain.of(figure), figure, ALL)[0], expected, atol=1e-4, rtol=1e-3)


def test_wishes_turn_with_the_object():
    placement = Placement(0.9, torch.tensor([1.0, 0.5, -2.0]).double().numpy())
    pose = pair("chair_sit").pose
    own = Constraints(seat_point=tuple(pose.root_position.tolist()), facing=0.0, hands=(("left", (0.1, 0.7, 0.2)),))
    point = placement.point_to_world(pose.root_position)
    hand = placement.point_to_world(torch.tensor([0.1, 0.7, 0.2]).numpy())
    world = Constraints(seat_point=tuple(point), facing=0.9, hands=(("left", tuple(hand)),))
    found = constraints_in(world, placement)
    assert found.seat_point == pytest.approx(own.seat_point, abs=1e-5)
    assert found.facing == pytest.approx(0.0, abs=1e-9)
    assert found.hands[0][1] == pytest.approx(own.hands[0][1], abs=1e-5)
