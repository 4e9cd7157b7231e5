"""Who stands steps by rule: feet under the body after a turn, one at a time, straight legs, and before a seat on its
goal's feet."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animation.state import Characters
from roam_motion.animation.stepping import Steps, halted, pose_feet, rise, standing_height, step
from roam_motion.animator import Animator, Goal, Idle, Steer
from roam_motion.control.actions import footing, seat_of
from roam_motion.control.seat import resting
from standing import goals_at, random_animator, seated_pose

WEIGHTS = Path(__file__).parents[3] / "weights" / "motion.safetensors"
FIGURE = humanoid_figure()
FEET = FIGURE.contacts
ANKLES = FEET[[0, 2]]
needs_weights = pytest.mark.skipif(not WEIGHTS.exists(), reason="weights/motion.safetensors is not there")


def standing_at(yaw=0.0, way=0.0):
    """A character at the origin facing +Z, and goals of someone who is to face `yaw` and go `way` metres a second."""
    characters = Characters.of(torch.from_numpy(random_animator().start((0, 0), 0.0, 0).row)[None])
    joints = FIGURE.positions(characters.hips, characters.orientations)
    goals = goals_at(seated_pose(), 0, active=False)
    goals.directions = torch.tensor([math.sin(yaw), math.cos(yaw)]).expand(1, 13, 2)
    goals.positions = torch.linspace(0, 2 * way, 13)[None, :, None] * goals.directions
    return characters, joints, goals


def stepped(characters, joints, goals, frames):
    """Feet that go where the rule has them, hips that stay: the joints of every frame, and the rule's memory."""
    shown, memory = [joints], []
    for _ in range(frames):
        steps, joints = step(FIGURE, characters, goals, joints, joints)
        characters = replace(characters, standing=steps.standing, steps=steps.progress)
        shown.append(joints)
        memory.append(steps)
    return torch.cat(shown), memory


def test_feet_of_a_turned_body_step_under_it_one_at_a_time():
    shown, memory = stepped(*standing_at(yaw=math.pi / 2), frames=60)
    lifted = torch.stack([(m.share > 0)[0] for m in memory])
    assert lifted.any(0).all()
    assert not lifted.all(1).any()
    toes = shown[-1, FEET[[1, 3]]] - shown[-1, ANKLES]
    assert (torch.atan2(toes[:, 0], toes[:, 2]) - math.pi / 2).abs().max() < math.radians(31)
    middle = shown[-1, ANKLES].mean(0)
    assert abs(float(middle[0]) + 0.10) < 0.05  # behind a body that faces +X
    assert abs(float(middle[2])) < 0.05
    assert shown[:, ANKLES, 1].max() > 0.12  # feet are lifted
    assert (shown[1:, ANKLES] - shown[:-1, ANKLES]).norm(dim=-1).max() < 0.07


def test_who_goes_on_is_left_to_the_network():
    characters, joints, goals = standing_at(yaw=math.pi / 2, way=0.9)
    shown, memory = stepped(characters, joints, goals, 20)
    assert torch.equal(shown[0], shown[-1])
    assert max(float(m.standing) for m in memory) == 0


def test_a_step_of_the_mirrored_state_is_the_mirrored_step():
    flip = torch.tensor([-1.0, 1.0, 1.0])
    swapped = torch.tensor(FIGURE.skeleton.mirror)
    characters, joints, goals = standing_at(yaw=1.0)
    mirrored = replace(goals, directions=goals.directions * flip[[0, 2]], positions=goals.positions * flip[[0, 2]])
    shown, memory = stepped(characters, joints, goals, 40)
    other, memories = stepped(characters, (joints * flip)[:, swapped], mirrored, 40)
    assert float((shown * flip)[:, swapped].sub(other).abs().max()) < 1e-5
    assert all(torch.equal(a.progress.flip(-1), b.progress) for a, b in zip(memory, memories, strict=True))
    assert any(m.progress.any() for m in memory)


def test_hips_rise_until_the_straighter_leg_is_nearly_stretched():
    _, joints, _ = standing_at()
    still = torch.zeros(1, 2)
    steps = Steps(torch.ones(1), still, still, torch.ones(1, 2), still)
    ankles = joints[:, ANKLES].clone()
    low = joints - torch.tensor([0.0, 0.12, 0.0])
    up = []
    for _ in range(120):
        up.append(float(rise(FIGURE, steps, low, ankles)[0, 1]))
        low = low + rise(FIGURE, steps, low, ankles)[:, None]
    assert max(up) <= 0.008 + 1e-6
    assert min(up) >= 0
    reach = (low[:, FIGURE.legs[:, 0]] - ankles).norm(dim=-1).max() / 0.82
    assert 0.97 < float(reach) < 0.986
    assert float(rise(FIGURE, replace(steps, standing=torch.zeros(1)), low - 0.1, ankles).abs().max()) == 0


def test_a_step_into_furniture_is_set_down_where_it_is():
    _, before, _ = standing_at()
    wanted = before.clone()
    wanted[:, FEET[:2]] += torch.tensor([0.05, 0.02, 0.0])
    clear = wanted.clone()
    clear[:, FEET[:2]] -= torch.tensor([0.03, 0.0, 0.0])
    feet = halted(FIGURE, before, wanted, clear, torch.tensor([[True, False]]))
    assert torch.allclose(feet[:, FEET[:2], 0], before[:, FEET[:2], 0] - 0.03)
    assert torch.allclose(feet[:, FEET[:2], 1], clear[:, FEET[:2], 1])
    assert torch.equal(feet[:, FEET[2:]], clear[:, FEET[2:]])


def test_before_a_seat_feet_belong_where_the_goal_pose_has_them():
    seat = seat_of(FIGURE, Goal(seated_pose(ahead=1.0)), (0.0, 3.0))
    feet = footing(FIGURE, seat)
    assert feet is not None
    goals, hips = seat.positions[ANKLES.numpy()][:, [0, 2]], seat.positions[0, [0, 2]]
    ahead = (feet[:, :2] - hips).mean(0) @ seat.stand[2:]
    assert ahead == pytest.approx(0.34, abs=1e-5)  # the goal's are 0.40 m before its hips: nobody balances over those
    np.testing.assert_allclose(feet[:, 0], goals[:, 0], atol=1e-6)
    np.testing.assert_allclose(feet[:, 2:], [[0, 1], [0, 1]], atol=1e-6)
    behind = (seat.stand[:2] - feet[:, :2].mean(0)) @ seat.stand[2:]
    assert behind == pytest.approx(0.10, abs=1e-5)  # who stands there has its feet there
    raised = seat_of(FIGURE, Goal(seated_pose(seat=0.6, ahead=1.0)), (0.0, 3.0))
    assert footing(FIGURE, raised) is None
    assert not pose_feet(FIGURE, torch.from_numpy(raised.positions)[None]).any()


def test_what_rests_on_furniture_is_told_from_the_goals_own_depths():
    seat = seat_of(FIGURE, Goal(seated_pose()), (0.0, 3.0))
    assert resting(FIGURE, seat) == (1.0, 1.0, 1.0)  # not known
    depths = np.zeros(2 * 6 + 2 * 5 + 3, np.float32)
    depths[6 + 4], depths[-2] = 0.01, 0.02  # the right hand's wrist, the upper chest
    assert resting(FIGURE, replace(seat, depths=depths)) == (0.0, 1.0, 1.0)
    assert resting(FIGURE, replace(seat, depths=0 * depths)) == (0.0, 0.0, 0.0)


def test_feet_go_to_the_goals_before_the_hips_sink_and_stay_while_they_do():
    characters, joints, _ = standing_at()
    goals = goals_at(seated_pose(ahead=-0.5), 2, active=True)
    goals.feet = pose_feet(FIGURE, goals.pose_positions)
    shown, _ = stepped(characters, joints, goals, 60)
    assert (shown[-1, ANKLES] - goals.pose_positions[0, ANKLES])[:, [0, 2]].norm(dim=-1).max() < 0.06
    low = replace(characters, hips=torch.tensor([[0.0, 0.8 * standing_height(FIGURE), 0.0]]))
    kept, memory = stepped(low, joints, goals, 20)
    assert torch.equal(kept[0], kept[-1])
    assert memory[-1].stays.all()
    seated = replace(characters, hips=goals.pose_positions[:, 0] + torch.tensor([0.0, 0.1, 0.0]))
    _, memory = stepped(seated, joints, goals, 20)
    assert not memory[-1].stays.any()


def told(animator, wishes):
    """Joints [T, J, 3] of a character told (intent, frames) one after the other."""
    states, shown = [animator.start((0.0, 0.0), 0.3, 3)], []
    for intent, frames in wishes:
        for _ in range(frames):
            ((state, frame),) = animator.step(states, [intent])
            states = [state]
            shown.append(frame.positions)
    return np.stack(shown)


def twist(joints):
    """Angle [T, 2] [rad] of each foot against the pelvis."""
    across = joints[:, FIGURE.legs[0, 0]] - joints[:, FIGURE.legs[1, 0]]
    feet = joints[:, FEET[[1, 3]]] - joints[:, ANKLES]
    apart = np.arctan2(feet[..., 0], feet[..., 2]) - np.arctan2(-across[:, 2], across[:, 0])[:, None]
    return np.abs((apart + np.pi) % (2 * np.pi) - np.pi)


@needs_weights
def test_a_character_told_to_turn_round_steps_and_ends_untwisted():
    back = Steer(np.zeros(2), np.array([math.sin(0.3 + 3.1), math.cos(0.3 + 3.1)]))
    joints = told(Animator.load(WEIGHTS), [(Idle(), 20), (back, 130)])
    angles = np.degrees(twist(joints))
    assert np.quantile(angles, 0.99) < 75
    assert angles[-1].max() < 32
    raised = joints[:, ANKLES, 1] > 0.105
    assert (np.diff(raised.astype(int), axis=0) == 1).sum() >= 3  # steps
    assert not raised.all(1).any()
    assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() < 0.10


@needs_weights
def test_a_character_that_stops_ends_with_its_feet_under_its_body():
    joints = told(Animator.load(WEIGHTS), [(Steer(np.array([0.27, 0.86])), 70), (Idle(), 110)])
    feet, hips = joints[-1, ANKLES], joints[-1, 0]
    facing = FIGURE.facing(torch.from_numpy(joints[-1:]))[0].numpy()
    ahead = (feet - hips)[:, [0, 2]] @ facing
    assert abs(ahead.mean() + 0.10) < 0.04
    assert abs(ahead[0] - ahead[1]) < 0.20
    assert np.abs(joints[-30:, ANKLES] - joints[-1, ANKLES]).max() < 0.02  # and stands
    reach = np.linalg.norm(joints[-1, FIGURE.legs[:, 0]] - feet, axis=-1) / 0.82
    assert reach.max() > 0.95
