"""The shown hips come to rest on a seat slowly, and are the body's own everywhere else."""

import numpy as np
import torch
from roam_motion.animation.prediction import Goals, goal_shapes
from roam_motion.animation.rows import row_width
from roam_motion.animation.shown.landing import lingering
from roam_motion.animation.state import Characters, characters_width

SEAT = 0.5  # [m] height of the goal's hips


def slide(height, *, active=1.0, urgency=0.0, column=2, frames=60, pace=0.015):
    """Places [T] along the floor of the shown hips of a body that slides back for ten frames, then stays."""
    goals = Goals.of(torch.zeros(1, row_width(goal_shapes(22))), 22)
    goals.pose_positions = torch.tensor([0.0, SEAT, 0.0]).expand(1, 22, 3)
    goals.active, goals.urgency = torch.tensor([active]), torch.tensor([urgency])
    goals.action = torch.eye(4)[column][None]
    body = Characters.of(torch.zeros(1, characters_width(22)))
    body.hips, shown = torch.tensor([[0.0, height, 0.3]]), []
    for frame in range(frames):
        before = body.hips
        body.hips = before - torch.tensor([0.0, 0.0, pace if frame < 10 else 0.0])
        body.linger = lingering(body, before, goals)
        shown.append(float((body.hips + body.linger)[0, 2]))
    return np.array(shown)


def test_hips_on_the_seat_settle_slowly_and_arrive():
    shown = slide(SEAT + 0.005)
    steps = -np.diff(shown)
    assert steps[12:].max() < 0.14 / 30
    assert (steps >= 0).all()
    assert abs(shown[-1] - 0.15) < 0.01


def test_they_are_never_left_far_behind():
    body = 0.3 - 0.03 * np.minimum(np.arange(1, 61), 10)
    assert np.abs(slide(SEAT, pace=0.03) - body).max() < 0.111


def test_nothing_holds_them_back_elsewhere():
    body = 0.3 - 0.015 * np.minimum(np.arange(1, 61), 10)
    for free in (
        slide(SEAT, active=0.0),
        slide(SEAT, urgency=1.0),
        slide(SEAT, column=3),
        slide(SEAT + 0.4),
    ):
        np.testing.assert_allclose(free, body, atol=1e-5)
