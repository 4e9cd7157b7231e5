from dataclasses import replace

import pytest
import torch
from roam_motion.animation.foot_contacts import plant
from roam_motion.animation.state import Characters
from roam_motion.animation.stepping import Steps
from standing import random_animator

GOING = Steps(torch.zeros(1), *(torch.zeros(1, 2) for _ in range(4)))  # nothing by rule


def standing():
    animator = random_animator()
    characters = Characters.of(torch.from_numpy(animator.start((0, 0), 0.0, 0).row)[None])
    figure = animator.figure
    return figure, characters, figure.positions(characters.hips, characters.orientations)


def planted(figure, characters, before, wanted, contacts, seated=0.0):
    feet = plant(
        figure, characters, GOING, before, wanted, characters.orientations, contacts,
        seated=torch.tensor([seated]), floor=torch.ones(1, 4),
        pushed=torch.zeros(1, 2, dtype=torch.bool),
    )  # fmt: skip
    characters = replace(characters)
    characters.locks, characters.lock_weights = feet.locks, feet.weights
    characters.hips, characters.orientations = feet.hips, feet.orientations
    return characters, figure.positions(feet.hips, feet.orientations)


def test_held_feet_stay_while_the_body_moves_on():
    figure, characters, joints = standing()
    first = joints.clone()
    for frame in range(6):
        wanted = first + torch.tensor([0.0, -0.02, 0.01 * (frame + 1)])
        characters, joints = planted(figure, characters, joints, wanted, torch.ones(1, 4))
    moved = (joints - first)[0]
    assert float(moved[figure.contacts][:, [0, 2]].norm(dim=-1).max()) < 0.004
    assert float(moved[0, 2]) > 0.05


def test_a_foot_without_contact_follows_the_network_no_faster_than_feet_move():
    figure, characters, joints = standing()
    wanted = joints + torch.tensor([0.0, 0.05, 0.30])
    before = joints
    for _ in range(8):
        characters, after = planted(figure, characters, before, wanted, torch.zeros(1, 4))
        assert float((after - before)[0, figure.contacts[[0, 2]]].norm(dim=-1).max()) < 0.11
        before = after
    assert float((before - wanted)[0, figure.contacts[[0, 2]]].norm(dim=-1).max()) < 0.05


def test_feet_stay_above_the_floor():
    figure, characters, joints = standing()
    wanted = joints - torch.tensor([0.0, 0.06, 0.0])
    _, after = planted(figure, characters, joints, wanted, torch.zeros(1, 4))
    assert float(after[0, figure.contacts, 1].min()) > 0.018


def test_a_foot_out_of_reach_is_let_go():
    figure, characters, joints = standing()
    wanted = joints + torch.tensor([0.0, 0.0, 0.9])
    wanted[0, figure.contacts] = joints[0, figure.contacts]
    characters, _ = planted(figure, characters, joints, wanted, torch.ones(1, 4))
    assert float(characters.lock_weights.max()) < 1.0


@pytest.mark.parametrize(("seated", "together"), [(0.5, False), (1.0, True)])
def test_misplaced_feet_step_one_after_the_other_until_the_seat_carries_the_body(seated, together):
    figure, characters, joints = standing()
    wanted = joints - torch.tensor([0.0, 0.01, 0.0])  # legs that are not quite stretched
    wanted[0, figure.contacts] = joints[0, figure.contacts] + torch.tensor([0.0, 0.0, 0.08])
    both_away = 0
    for _ in range(60):
        characters, joints = planted(figure, characters, joints, wanted, torch.ones(1, 4), seated=seated)
        away = (characters.lock_weights > 0) & (characters.lock_weights < 1)
        both_away += int(away[0, :2].any() and away[0, 2:].any())
    assert (both_away > 0) == together
    assert float((joints - wanted)[0, figure.contacts[[0, 2]]][:, [0, 2]].norm(dim=-1).max()) < 0.015
