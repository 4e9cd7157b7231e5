"""Measures of motion have known answers on synthetic people."""

import numpy as np
import pytest
from roam_evaluation.motion.people.frames import ANKLES, THIGHS, Motion
from roam_evaluation.motion.people.measures import sitting, turning, walking
from roam_evaluation.motion.people.measures.posture import bends, centre_of_mass, lean, twist
from roam_evaluation.motion.people.registry import measures
from roam_evaluation.motion.people.storage import read_motions, write_motions
from roam_evaluation.motion.people.verdict import Spread, outside
from walkers import sitter, standing, turner, walker


def first_window(motion):
    found = walking.windows(motion, (0.5, 2.0))
    assert found
    return walking.measure(found[0])


def test_a_walker_has_the_step_and_cadence_it_was_made_with():
    found = first_window(walker(speed=0.9, cycle=36, width=0.12))
    assert found["speed"] == pytest.approx(0.9, abs=0.02)
    assert found["cadence"] == pytest.approx(100.0, abs=3.0)  # two steps in 36 frames
    # Half of 0.9 m/s x 1.2 s, less what the foot still goes after it was farthest in front of the hips.
    assert 49.0 < found["step_length"] < 54.5
    assert found["step_width"] == pytest.approx(12.0, abs=0.5)
    assert found["step_difference"] < 3.0
    assert found["arm_swing"] == pytest.approx(20.0, abs=1.0)
    assert found["change_between_strides"] == pytest.approx(0.0, abs=0.1)


def test_a_limp_shows_as_a_difference_of_left_and_right():
    even, limping = first_window(walker(limp=0.0)), first_window(walker(limp=0.06))
    assert even["step_difference"] < 3.0
    assert limping["step_difference"] == pytest.approx(100 * 0.12 / 0.54, abs=5.0)


def test_planted_feet_do_not_skate_and_a_glider_is_no_walker():
    assert first_window(walker())["foot_skate"] < 6.0  # contact begins before the foot has stopped
    gliding = standing(120)
    gliding[..., 2] += 0.9 * np.arange(120)[:, None] / 30
    assert not walking.windows(Motion("glider", "nobody", gliding), (0.5, 2.0))


@pytest.mark.parametrize("angle", [90.0, 135.0])
def test_feet_that_stay_are_twisted_by_the_whole_turn_and_take_no_step(angle):
    (turn,) = turning.turns(turner(angle=angle, feet="stay"))
    found = turning.measure(turn)
    assert found["twist_most"] == pytest.approx(angle, abs=1.0)
    assert found["twist_at_end"] == pytest.approx(angle, abs=1.0)
    assert found["steps_per_quarter"] == 0.0


def test_feet_that_turn_along_are_not_twisted_and_count_as_steps():
    (turn,) = turning.turns(turner(angle=-90.0, feet="along"))
    found = turning.measure(turn)
    assert found["twist_most"] == pytest.approx(0.0, abs=1.0)
    assert found["steps_per_quarter"] == pytest.approx(2.0, abs=0.3)


def test_a_sitter_leans_as_far_as_it_leans_and_lands_where_it_lands():
    (sit,) = sitting.sits(sitter(lean=45.0, drop=0.42, back=0.2))
    down, up = sitting.measure_down(sit), sitting.measure_up(sit)
    assert down is not None
    assert up is not None
    upright = lean(Motion("", "", standing(3)))[0]  # the rest pose's neck is a little behind its hip joints
    assert down["lean_down"] == pytest.approx(45.0 + upright, abs=1.0)
    assert up["lean_up"] == pytest.approx(45.0 + upright, abs=1.0)
    assert 10.0 < down["hips_back"] < 20.0
    assert 0.5 < down["descent"] < 1.0
    assert down["feet_after_contact"] == pytest.approx(0.0, abs=0.01)
    assert up["ankles_ahead_leaving"] == pytest.approx(20.0, abs=1.0)


def test_statues_do_not_spread_while_seated():
    (sit,) = sitting.sits(sitter(hold=180))
    found = sitting.measure_seated(sit)
    assert len(found) == 2
    assert all(value == pytest.approx(0.0, abs=1e-6) for row in found for value in row.values())


def test_the_centre_of_mass_of_somebody_who_stands_is_over_the_feet_and_moves_with_the_body():
    positions = standing(2)
    mass = centre_of_mass(positions)
    assert 0.85 < mass[0, 1] < 1.05
    assert mass[0, 0] == pytest.approx(0.0, abs=1e-6)
    assert centre_of_mass(positions + np.array([0.3, 0, 0]))[0, 0] == pytest.approx(0.3, abs=1e-6)


def test_angles_of_a_bent_knee_and_a_turned_pelvis():
    positions = standing(3)
    positions[:, ANKLES[0]] = positions[:, 15] + [0, 0, -0.42]  # the left shin points back
    assert bends(positions)[0, 0] == pytest.approx(90.0, abs=1e-6)
    assert bends(positions)[0, 1] == pytest.approx(0.0, abs=1e-3)
    assert twist(Motion("", "", standing(3))) == pytest.approx(0.0, abs=1e-6)


def test_a_median_is_outside_by_widths_of_peoples_range():
    people = Spread(10.0, 15.0, 20.0, 12, 4)
    assert outside(12.0, people) == 0.0
    assert outside(25.0, people) == pytest.approx(0.5)
    assert outside(5.0, people) == pytest.approx(0.5)
    assert outside(5.0, people, one_sided=True) == 0.0


def test_every_measure_of_the_table_is_made_and_every_made_one_is_in_the_table():
    (sit,) = sitting.sits(sitter(hold=180))
    (turn,) = turning.turns(turner())
    made = {
        "walk": first_window(walker()),
        "turn": turning.measure(turn),
        "sit_down": sitting.measure_down(sit),
        "stand_up": sitting.measure_up(sit),
        "seated": sitting.measure_seated(sit)[0],
    }
    for group, values in made.items():
        assert {m.key for m in measures(group)} == set(values), group


def test_recorded_frames_come_back(tmp_path):
    motion = sitter()
    write_motions(tmp_path / "frames.npz", [motion, walker()])
    again, _ = read_motions(tmp_path / "frames.npz")
    assert again.stretches == motion.stretches
    assert np.abs(again.positions - motion.positions).max() < 1e-6
    assert THIGHS == [14, 18]
