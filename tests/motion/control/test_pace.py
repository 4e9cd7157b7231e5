"""Speeds: what is followed of a wanted velocity, and who walks how fast."""

import numpy as np
import pytest
from roam_motion.animation.manner import NAMES, drawn
from roam_motion.animator import Steer
from roam_motion.control.pace import cut_to, fastest, followed


def steer(speed, angle=0.0, facing=True):
    velocity = speed * np.array([np.sin(angle), np.cos(angle)])
    return Steer(velocity, np.array([0.0, 1.0]) if facing else None)


@pytest.mark.parametrize(("speed", "angle"), [(0.0, 0.0), (0.6, 0.0), (1.5, 0.0), (0.8, 1.57), (0.8, 3.14), (1.1, 0.5)])
def test_what_a_character_can_do_is_followed_as_asked(speed, angle):
    wish = steer(speed, angle)
    np.testing.assert_allclose(followed(wish), wish.velocity)
    assert cut_to(wish) is None


@pytest.mark.parametrize(("speed", "angle"), [(3.0, 0.0), (2.0, 0.8), (1.2, 1.57), (1.0, 3.14), (9.0, -2.0)])
def test_faster_wishes_are_cut_in_their_direction_and_say_so(speed, angle):
    wish = steer(speed, angle)
    kept = np.array(followed(wish))
    assert cut_to(wish) == pytest.approx(fastest(angle))
    assert np.linalg.norm(kept) == pytest.approx(fastest(angle))
    np.testing.assert_allclose(kept / np.linalg.norm(kept), wish.velocity / speed)


def test_who_faces_the_way_they_go_may_go_fastest():
    assert followed(steer(1.5, 2.0, facing=False)) == pytest.approx(tuple(steer(1.5, 2.0).velocity))
    assert fastest(0.0) > fastest(1.0) > fastest(1.57)


def test_a_seed_is_a_person_within_the_range_of_people():
    people = np.stack([drawn(seed) for seed in range(400)])
    assert people.shape[1] == len(NAMES)
    assert np.abs(people).max() <= 1.645
    assert (np.abs(people.mean(0)) < 0.2).all()
    assert (people.std(0) > 0.8).all()
    np.testing.assert_array_equal(drawn(7), people[7])
    assert np.abs(np.corrcoef(people.T) - np.eye(len(NAMES))).max() < 0.2
