"""What counts as a good pose."""

import math

import pytest
from roam_evaluation.goalpose.inputs.cases import plain_case, scaled_case, turned_case
from roam_evaluation.goalpose.runs import hip_height_of, judge, run_from
from roam_goalpose.synthesis import GoalPoseResult
from seating import CHAIR, run, sitter


@pytest.mark.parametrize(
    ("change", "success", "strict"),
    [
        ({}, True, True),
        ({"hip_distance": 0.06}, True, False),
        ({"hip_distance": 0.09}, False, False),
        ({"hip_distance": None}, False, False),
        ({"heading_error": math.radians(17)}, True, False),
        ({"heading_error": math.radians(21)}, False, False),
        ({"heading_error": None}, True, True),
        ({"penetration": 0.031}, True, False),
        ({"floor": 0.05}, True, False),
        ({"floor": 0.05, "hang": 0.025}, True, True),
        ({"floor": 0.05, "hang": 0.015}, True, False),
        ({"floor": None}, True, True),
    ],
)
def test_success(change, success, strict):
    assert (run(**change).success, run(**change).strict) == (success, strict)


def test_records_come_back():
    there = run(turn_error=0.012345)
    back = run_from(there.record())
    assert back.turn_error == 0.0123
    assert back.pose.positions() == pytest.approx(there.pose.positions(), abs=1e-3)


def answer(pose):
    return GoalPoseResult(
        name="goalPoses/sha256:0",
        pose=pose,
        energies={"total": 0.0},
        diagnostics={"floor_distance": 0.0},
        warnings=(),
        reference="chair_sit",
        action="sit",
        floor_height=0.0,
        object="objects/sha256:0",
        seconds=0.0,
        candidates=(),
    )


def judged(case, pose):
    return judge(
        case,
        answer(pose),
        expected_hip=hip_height_of(sitter()),
        variant="plain",
        initial_yaw=None,
        cpu_seconds=0.0,
        beside=None,
    )


def test_judges_a_sitter_well_and_one_who_sits_askew_or_too_deep_badly():
    case, pose = plain_case(CHAIR), sitter().pose
    assert judged(case, pose).success
    assert not judged(case, pose.turned(math.radians(40))).success
    sunk = judged(case, pose.moved([0.0, -0.1, 0.0]))
    assert not sunk.success
    assert sunk.penetration == pytest.approx(judged(case, pose).penetration + 0.1, abs=0.03)
    assert {"leftUpperLeg", "rightUpperLeg"} <= sunk.bone_depths.keys()


def test_brings_poses_on_a_turned_upload_back():
    plain = plain_case(CHAIR)
    turned = turned_case(plain, seed=3)
    pose = sitter().pose.turned(turned.yaw).moved(turned.offset)
    here, there = judged(plain, sitter().pose), judged(turned, pose)
    assert there.root_position == pytest.approx(here.root_position, abs=1e-4)
    assert there.hip_distance == pytest.approx(here.hip_distance, abs=1e-4)


def test_feet_on_a_low_seat_may_not_hang_and_on_a_high_one_by_as_much_as_it_is_too_high():
    pose, low = sitter().pose, plain_case(CHAIR)
    assert judged(low, pose).hang < 0.01
    high = scaled_case(low, 1.4)
    edge = high.region.edge - high.truth.floor_height
    assert edge > 0.6
    assert judged(high, pose).hang == pytest.approx(edge - 0.46, abs=1e-6)
