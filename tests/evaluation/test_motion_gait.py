"""Steady walking is found where it is, and measured."""

import numpy as np
import pytest
from roam_character.pose import rest_pose
from roam_character.skeleton import humanoid_skeleton
from roam_evaluation.motion.gait import beside, gait, steady
from roam_evaluation.motion.measures import Track, walking_features
from roam_motion.animation.figure import humanoid_figure

FIGURE = humanoid_figure()


def gliding(speed, *, height=0.0, swing=0.0, frames=100):
    """A rest pose that glides forward (+Z) and swings its left hand by so many metres."""
    t = np.arange(frames) / 30
    positions = np.repeat(rest_pose(humanoid_skeleton()).positions()[None], frames, 0)
    positions[..., 2] += (speed * t)[:, None]
    positions[..., 1] += height
    positions[:, FIGURE.skeleton.index("leftHand"), 2] += swing / 2 * np.sin(2 * np.pi * t)
    return Track(positions.astype(np.float32), np.ones((frames, 4), bool))


def test_only_walking_straight_on_at_the_speed_of_approaches_is_steady():
    assert len(steady(FIGURE, gliding(0.85))) == 2
    assert not steady(FIGURE, gliding(0.4))
    assert not steady(FIGURE, gliding(-0.85))
    assert not steady(FIGURE, gliding(0.85, height=-0.3))


def test_an_arm_swings_as_far_as_it_swings():
    window = steady(FIGURE, gliding(0.85, swing=0.2))[0]
    found = gait(FIGURE, window)
    assert found.arm_swing == pytest.approx(10.0, abs=0.3)  # the mean of both arms
    assert found.stride == pytest.approx(0.0, abs=1e-3)


def test_hips_that_sit_down_do_not_walk():
    assert len(walking_features(FIGURE, gliding(0.85, height=-0.3))) == 0


def test_the_same_walk_has_no_distance_from_itself():
    tracks = [gliding(0.8 + 0.02 * n, swing=0.1 + 0.02 * n) for n in range(6)]
    report = beside(FIGURE, tracks, tracks, tracks)
    assert report["frechet_of_made"] == pytest.approx(0.0, abs=0.05)
    assert report["made"]["windows"] == 12
