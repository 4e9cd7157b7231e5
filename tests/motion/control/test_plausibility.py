"""Goals that a character can take, and goals that are refused when they are sent, saying why."""

from dataclasses import replace

import numpy as np
import pytest
from roam_character.pose import Pose
from roam_character.rotation import quat_from_rotvec, quat_mul
from roam_character.volume import STEP, Volume
from roam_motion.animation.figure import humanoid_figure
from roam_motion.control.intent import Goal
from roam_motion.control.plausibility import ImplausibleGoalError, UnreachableGoalError, check_goal
from standing import seated_pose

FIGURE = humanoid_figure()
START = (0.0, 2.5)


def block(low, high):
    """A box as furniture, sampled like a server samples it."""
    low, high, pitch = np.array(low), np.array(high), 0.05
    origin = low - 0.1
    size = np.ceil((high - low + 0.2) / pitch).astype(int) + 1
    nodes = origin + pitch * np.stack(np.meshgrid(*(np.arange(n) for n in size), indexing="ij"), -1)
    apart = np.maximum(low - nodes, nodes - high)
    distance = np.linalg.norm(np.maximum(apart, 0), axis=-1) + np.minimum(apart.max(-1), 0)
    values = np.clip(np.round(distance / STEP), -127, 127).astype(np.int8)
    return Volume(origin.astype(np.float32), pitch, 0.0, values)


CHAIR = block([-0.25, 0.0, -0.25], [0.25, 0.45, 0.25])
BED = block([-0.5, 0.0, -1.0], [0.5, 0.45, 1.0])


def lying_pose(height=0.55):
    """On the back, head towards -Z."""
    pose = seated_pose()
    flat = quat_from_rotvec(np.array([-np.pi / 2, 0, 0], np.float32))
    rotations = pose.skeleton.rest_rotations.astype(np.float32).copy()
    rotations[0] = quat_mul(flat, rotations[0])
    return Pose(pose.skeleton, np.array([0, height, 0], np.float32), rotations)


def moved(goal, offset):
    """The pose alone: what a client gets wrong that moves an object and forgets its volume."""
    return replace(goal, pose=goal.pose.moved(np.array(offset, np.float32)))


SIT = Goal(seated_pose(), "sit", volume=CHAIR)
LIE = Goal(lying_pose(), "lie", volume=BED)


@pytest.mark.parametrize("goal", [SIT, LIE, replace(SIT, volume=None), replace(LIE, volume=None)])
def test_goals_on_their_furniture_are_taken(goal):
    check_goal(FIGURE, goal, START)


@pytest.mark.parametrize(
    ("goal", "field", "words"),
    [
        (moved(LIE, [1.0, 0, 0]), "volume", "move pose, volume and obstacles together"),
        (moved(SIT, [0, 0, -1.2]), "volume", "move pose, volume and obstacles together"),
        (moved(SIT, [9_000, 0, 0]), "volume", "outside the volume"),
        (moved(SIT, [0, 0.45, 0]), "volume", "from the volume's furniture"),
        (replace(LIE, pose=seated_pose()), "action", "ask for SIT"),
        (replace(SIT, pose=lying_pose()), "action", "ask for LIE"),
        (moved(replace(SIT, volume=None), [0, 1.5, 0]), "pose.root_position", "above the session's floor"),
        (moved(replace(SIT, volume=None), [0, -1.0, 0]), "pose.root_position", "under the session's floor"),
    ],
)
def test_what_no_body_can_do_is_refused_with_the_reason(goal, field, words):
    with pytest.raises(ImplausibleGoalError, match=words) as caught:
        check_goal(FIGURE, goal, START)
    assert caught.value.field == field


def ring(inner, outer, gap=0.0):
    """Four walls round the origin; `gap` [m] is left open between two of them."""
    i, o = inner, outer
    walls = [((-o, i), (o - gap, i), (o - gap, o), (-o, o)), ((-o, -o), (o, -o), (o, -i), (-o, -i))]
    walls += [((-o, -i), (-i, -i), (-i, i), (-o, i)), ((i, -i), (o, -i), (o, i), (i, i))]
    return tuple(walls)


def test_a_goal_behind_walls_is_said_so_and_one_with_a_door_is_not():
    with pytest.raises(UnreachableGoalError, match="shut off the way"):
        check_goal(FIGURE, replace(SIT, obstacles=ring(1.6, 1.8)), START)
    walls = ring(1.6, 1.8)
    check_goal(FIGURE, replace(SIT, obstacles=walls[1:]), START)
    check_goal(FIGURE, replace(SIT, obstacles=walls), (0.0, 1.2))


def test_extreme_goals_are_refused_or_taken_and_nothing_else():
    """Four hundred random goals: furniture moved, actions swapped, poses turned and thrown."""
    rng = np.random.default_rng(5)
    refused = 0
    for _ in range(400):
        goal = [SIT, LIE][rng.integers(2)]
        goal = moved(goal, rng.normal(size=3) * 10 ** rng.uniform(-2, 4))
        if rng.random() < 0.3:
            goal = replace(goal, action=["sit", "lie"][rng.integers(2)])
        if rng.random() < 0.3:
            turned = quat_mul(quat_from_rotvec(rng.normal(size=3).astype(np.float32) * 2), goal.pose.rotations[0])
            rotations = goal.pose.rotations.copy()
            rotations[0] = turned
            goal = replace(goal, pose=Pose(goal.pose.skeleton, goal.pose.root_position, rotations))
        if rng.random() < 0.3:
            goal = replace(goal, volume=None)
        try:
            check_goal(FIGURE, goal, tuple(rng.normal(size=2) * 3))
        except (ImplausibleGoalError, UnreachableGoalError):
            refused += 1
    assert 100 < refused < 400
