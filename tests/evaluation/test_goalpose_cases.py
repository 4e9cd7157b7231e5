"""Uploads as careless users send them."""

import numpy as np
import pytest
from roam_character.distance import turn_about_y
from roam_evaluation.goalpose.inputs.cases import (
    cloud_case,
    faced_case,
    plain_case,
    scaled_case,
    spun_case,
    tilted_case,
    tumbled_case,
    turned_case,
)
from seating import CHAIR, sitter


@pytest.fixture(scope="module")
def chair():
    return plain_case(CHAIR)


def test_turning_and_another_up_axis_keep_the_size(chair):
    turned, tumbled = turned_case(chair, seed=3), tumbled_case(chair, seed=3)
    height = np.ptp(chair.truth.bounds[:, 1])
    assert np.ptp(turned.given.bounds[:, 1]) == pytest.approx(height, abs=1e-3)
    assert tumbled.given.bounds == pytest.approx(turned.given.bounds, abs=1e-3)  # up was found
    assert turned.truth is chair.truth


@pytest.mark.parametrize(("change", "seed"), [(tilted_case, 1), (tilted_case, 2), (spun_case, 3)])
def test_a_chair_that_leans_is_given_upright_and_its_pose_is_brought_back(chair, change, seed):
    leaning = change(chair, seed)
    assert [warning.reason for warning in leaning.given.warnings] == ["OBJECT_TILTED"]
    assert np.ptp(leaning.given.bounds[:, 1]) == pytest.approx(np.ptp(chair.truth.bounds[:, 1]), abs=0.01)
    front = leaning.given.front @ turn_about_y(leaning.yaw)  # back to the canonical object's heading
    assert front / np.linalg.norm(front) == pytest.approx([0.0, 0.0, 1.0], abs=0.02)


def test_whoever_looks_along_z_begins_at_the_asked_heading(chair):
    faced = faced_case(chair, 0.5 * np.pi)
    back = faced.brought_back(sitter().pose)
    assert back.yaw() == pytest.approx(sitter().pose.yaw() + 0.5 * np.pi, abs=1e-5)
    front = faced.given.front / np.linalg.norm(faced.given.front)
    assert front == pytest.approx([-1.0, 0.0, 0.0], abs=1e-3)


def test_scaling_makes_another_object(chair):
    larger = scaled_case(chair, 1.2)
    assert np.ptp(larger.truth.bounds, axis=0) == pytest.approx(1.2 * np.ptp(chair.truth.bounds, axis=0), abs=1e-3)
    assert larger.region.height == pytest.approx(1.2 * chair.region.height, abs=0.02)


def test_an_unseen_back_is_missing(chair):
    def rearmost(case):
        return case.given.points[:, 2].min()

    seen, unseen = cloud_case(chair, count=5000), cloud_case(chair, count=5000, hidden_from=np.pi)
    assert seen.given.mesh is None
    share = [(case.given.points[:, 2] < rearmost(seen) + 0.02).mean() for case in (seen, unseen)]
    assert share[1] < share[0] / 2


def test_noise_blurs_the_surface(chair):
    def apart(case):
        return np.abs(chair.truth.distance.sample(case.given.points)).mean()

    assert apart(cloud_case(chair, count=5000, noise=0.01)) > apart(cloud_case(chair, count=5000)) + 0.002
