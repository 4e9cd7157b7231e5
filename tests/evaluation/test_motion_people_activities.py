"""Running, standing, sliding, lying, variety and the blind test have known answers on synthetic people."""

import numpy as np
import pytest
from roam_evaluation.motion.people import blind
from roam_evaluation.motion.people.activities import ACTIVITIES
from roam_evaluation.motion.people.frames import ANKLES, RATE, THIGHS, TOES, Motion, Stretch
from roam_evaluation.motion.people.measures import feet, lying, running, standing, variety
from roam_evaluation.motion.people.registry import measures
from roam_evaluation.motion.people.report import table
from roam_evaluation.motion.people.targets import targets
from roam_evaluation.motion.people.verdict import judge, summary
from walkers import sitter, turner, walker
from walkers import standing as stands

FEET = [*ANKLES, *TOES]


def paced(*parts):
    """Glides along +Z: (seconds, speed from, speed to) after one another."""
    speed = np.concatenate([np.linspace(a, b, round(s * RATE)) for s, a, b in parts])
    positions = stands(len(speed))
    positions[..., 2] += np.cumsum(speed / RATE)[:, None]
    return Motion("paced", "nobody", positions)


def test_a_hopper_is_in_the_air_for_as_long_as_its_toes_are():
    positions = stands(60)
    positions[::2, :, 1] += 0.10
    assert running.airborne(positions).mean() == pytest.approx(0.5)
    assert not running.airborne(stands(60)).any()


def test_a_runner_has_the_cadence_and_speed_it_was_made_with():
    window = running.windows(walker(speed=2.6, cycle=22, seconds=3.0), (1.8, 3.6))[0]
    found = running.measure(window)
    assert found["speed"] == pytest.approx(2.6, abs=0.05)
    assert found["cadence"] == pytest.approx(2 * 60 * RATE / 22, rel=0.05)
    assert set(found) == {m.key for m in measures("run")}


def test_a_stop_takes_as_long_as_the_hips_take():
    motion = paced((3.0, 1.0, 1.0), (1.0, 1.0, 0.0), (3.0, 0.0, 0.0))
    (frame,) = standing.stops(motion)
    found = standing.measure_stop(motion, frame)
    assert found["stopping"] == pytest.approx(0.48, abs=0.15)  # from 0.6 to 0.12 m/s at 1 m/s^2
    assert found["knees"] == pytest.approx(0.0, abs=0.1)
    assert found["twist"] == pytest.approx(0.0, abs=1e-6)
    assert set(found) == {m.key for m in measures("stop")}


def test_setting_off_is_found_once_and_a_glider_moves_its_feet_with_its_hips():
    motion = paced((2.0, 0.0, 0.0), (1.0, 0.0, 1.0), (2.0, 1.0, 1.0))
    (frame,) = standing.starts(motion)
    found = standing.measure_start(motion, frame)
    assert found["starting"] == pytest.approx(0.48, abs=0.15)
    assert found["first_step"] == pytest.approx(found["other_foot"])
    assert set(found) == {m.key for m in measures("start")}


def test_statues_stand_without_spreading():
    windows = standing.idles(paced((5.0, 0.0, 0.0)))
    assert len(windows) == 2
    found = standing.measure_idle(windows[0])
    assert found["idle_head"] == pytest.approx(0.0, abs=1e-9)
    assert set(found) == {m.key for m in measures("idle")}


def test_toes_that_slide_low_skate_and_those_that_pass_high_do_not():
    low = paced((2.0, 0.3, 0.3)).positions  # toe joints 2.5 cm over the floor
    assert feet.benchmark(low)["toe_skate"] == pytest.approx(30.0, abs=0.1)
    assert feet.benchmark(low)["skate_ratio"] == pytest.approx(100.0)
    assert feet.benchmark(stands(60))["toe_skate"] == pytest.approx(0.0)
    high = low + np.array([0, 0.05, 0])
    assert np.isnan(feet.benchmark(high)["skate_ratio"])


def test_a_planted_foot_that_creeps_slides_as_far_as_it_creeps():
    positions = stands(60)
    positions[:, FEET[0], 2] += np.linspace(0, 0.012, 60)
    found = feet.slides(positions)
    assert found["slide"] == pytest.approx(1.2 * 57 / 59 / 4, abs=0.01)  # one of four joints
    assert feet.slides(stands(60))["slide"] == pytest.approx(0.0)


def test_feet_of_somebody_who_stands_straight_are_not_twisted():
    found = feet.measure(walker())
    assert found["twist_p99"] < 5.0
    assert found["twisted_share"] == 0.0
    assert set(found) == {m.key for m in measures("feet")}
    assert feet.measure(turner(angle=120.0))["twisted_share"] > 40.0


def recliner(seconds=2.0):
    """Its trunk falls back by 90 degrees at a constant rate from sitting height, lies, and comes up the same way."""
    down = round(seconds * RATE)
    angle = np.concatenate(
        [np.zeros(40), np.linspace(0, 90, down), np.full(60, 90.0), np.linspace(90, 0, down), np.zeros(40)]
    )
    height = np.clip(np.concatenate([np.linspace(0, 1, 25), np.ones(len(angle) - 50), np.linspace(1, 0, 25)]), 0, 1)
    positions = stands(len(angle))
    positions[..., 1] -= 0.4 * height[:, None]
    upper = [j for j in range(22) if j not in (*FEET, 14, 15, 18, 19)]
    pivot = positions[:, THIGHS].mean(1, keepdims=True)
    offset, a = positions[:, upper] - pivot, np.radians(angle)[:, None]
    turned = [offset[..., 1] * np.cos(a) + offset[..., 2] * np.sin(a), offset[..., 2] * np.cos(a)]
    positions[:, upper] = pivot + np.stack([offset[..., 0], turned[0], turned[1] - offset[..., 1] * np.sin(a)], -1)
    return Motion("recliner", "nobody", positions, (Stretch("lie held", 40 + down, 40 + down + 59),))


def test_reclining_takes_its_share_of_the_fall_and_getting_up_is_seen_to_be_the_same_reversed():
    motion = recliner(seconds=2.25)
    found = lying.measure_down(motion, motion.stretches[0])
    assert found is not None
    assert found["recline"] == pytest.approx(2.25 * 40 / 90, abs=0.15)
    assert set(found) == {m.key for m in measures("lie_down")}
    assert lying.reversal(motion, motion.stretches[0]) < 1.5  # cm; the two are cut at slightly different heights


def test_differences_of_persons_are_those_of_their_means():
    people = variety.by_person([("a", {"x": 1.0}), ("a", {"x": 3.0}), ("b", {"x": 5.0}), ("c", {"x": 2.0})])
    found = {name: row["x_differs"] for name, row in variety.differences(people, ["x"])}
    assert found == {"a and b": 3.0, "a and c": 0.0, "b and c": 3.0}


def test_one_pair_that_is_alike_is_chance_and_six_are_not():
    pairs = [{"x": float(d)} for d in (0, 0, 2, 2, 2, 2, 2, 2, 2, 2)]
    found = [row["x"] for row in variety.together(pairs)]
    assert len(found) == 200
    assert min(found) == pytest.approx(np.sqrt(4 * 4 / 6))  # both that are alike, and four others
    assert max(found) == pytest.approx(2.0)
    assert variety.together(pairs[1:3]) == [{"x": pytest.approx(np.sqrt(2.0))}]


def test_the_same_are_not_told_apart_and_others_are():
    random = np.random.default_rng(0)

    def group(shift):
        persons = [f"{k}" for k in range(8) for _ in range(20)]
        return random.normal(size=(160, 45)) + shift, persons

    assert blind.told_apart(group(0.0), group(0.0)) == pytest.approx(50.0, abs=12.0)
    assert blind.told_apart(group(0.0), group(1.0)) > 95.0


def test_neither_frame_rate_nor_noise_nor_height_nor_heading_gives_anybody_away():
    motion = walker(seconds=4.0)
    noisy = motion.positions + np.random.default_rng(0).normal(scale=0.001, size=motion.positions.shape)
    a, b = (Motion("", "", blind.washed(p)).cut(30, 59) for p in (motion.positions, noisy))
    assert np.abs(blind.features(a)[: 10 * 42] - blind.features(b)[: 10 * 42]).max() < 0.03
    x, y, z = (motion.positions[..., i] for i in range(3))
    moved = Motion("", "", np.stack([z + 1.0, y + 0.05, -x], -1))  # turned by 90 degrees, higher up
    assert blind.features(moved.cut(30, 59)) == pytest.approx(blind.features(motion.cut(30, 59)), abs=1e-6)


def test_who_moves_as_people_do_is_inside_on_every_measure():
    def told(motion, told, who):
        return Motion(f"{told}, seed {who}", str(who), motion.positions, motion.stretches, told)

    people = [Motion("cmu_x", str(k), sitter(lean=40 + k / 2).positions, sitter().stretches) for k in range(24)]
    ours = [told(sitter(lean=40 + k / 2), "sit", k) for k in range(24)]
    upright = [told(sitter(lean=k / 8), "sit", k) for k in range(24)]
    (activity,) = [a for a in ACTIVITIES if a.key == "sit_down"]
    fine, poor = (
        judge(activity, activity.made(made), activity.captured(people), activity.captured(people[:3]))
        for made in (ours, upright)
    )
    assert summary(fine)["inside_percent"] == 100.0
    (lean,) = [v for v in poor if v.measure.key == "lean_down"]
    assert not lean.inside
    assert lean.which == "held-out"
    assert "OUT" in table(poor, ACTIVITIES)
    kept = {t.title: t.kept for t in targets(ours, (0.0, 20.0))}
    assert kept["goal poses reached within 5 cm"]
