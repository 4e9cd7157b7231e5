from dataclasses import fields

import numpy as np
import pytest
import torch
from roam_motion.animation.advance import advance
from roam_motion.animation.blending import WHOLE
from roam_motion.animation.living import WIDTH, Life, alive, gazed
from roam_motion.animation.prediction import Goals
from roam_motion.animation.rows import join, split_array, split_tensor
from roam_motion.animation.state import Characters, characters_width
from roam_motion.animation.swing import swinging, walking
from roam_motion.animator import Goal
from roam_motion.control.actions import seat_of
from roam_motion.control.controller import GoalRows
from roam_motion.graphs import Graphs
from standing import random_animator, random_model, seated_pose


@pytest.mark.parametrize("count", [1, 2, 9, 70])
def test_graphs_do_what_the_step_of_training_does(count):
    animator = random_animator()
    figure = animator.figure
    prediction = random_model(seed=1).predictor()
    states = [animator.start((0.3 * i, -0.1 * i), 0.2 * i, i) for i in range(count)]
    seat = seat_of(figure, Goal(seated_pose(ahead=0.2)), (0.0, 0.0))
    places, directions = np.full((13, 2), 0.4, np.float32), np.tile(np.float32([0.0, 1.0]), (13, 1))
    goals = GoalRows(figure, count)
    for i in range(count):
        if i % 2:
            goals.take(i, seat, "sit", 0.0, None)
        else:
            goals.go(i, places, directions, "walk", None)
    rows = np.stack([s.row for s in states])
    life = np.random.default_rng(0).random((count, WIDTH)).astype(np.float32)
    shown = Graphs(figure, prediction, WHOLE).step(rows, goals.rows, life, None)
    with torch.no_grad():
        characters = Characters.of(torch.from_numpy(rows))
        after, joints, _ = advance(
            figure, prediction, characters, Goals.of(torch.from_numpy(goals.rows), figure.joint_count)
        )
        told = Life.of(torch.from_numpy(life))
        after.gaze = gazed(figure, after, joints, told)
        orientations = swinging(figure, joints, after.orientations, walking(after), after.manner)
        orientations = alive(figure, after, orientations, told)
    np.testing.assert_allclose(shown.rows, after.rows(), atol=2e-4)
    np.testing.assert_allclose(shown.positions, figure.positions(after.hips, orientations), atol=1e-5)
    np.testing.assert_allclose(shown.snorm16 / 32767, shown.rotations, atol=2e-5)


def test_rows_keep_every_field():
    numbers = torch.arange(2.0 * characters_width(22)).reshape(2, -1)
    characters = Characters.of(numbers)
    assert torch.equal(characters.rows(), numbers)
    shapes = {field.name: tuple(getattr(characters, field.name).shape[1:]) for field in fields(Characters)}
    arrays, tensors = split_array(characters.rows().numpy(), shapes), split_tensor(characters.rows(), shapes)
    assert all(np.array_equal(arrays[name], tensors[name]) for name in shapes)
    assert torch.equal(join(tensors), characters.rows())
