"""Lying poses are judged by what holds them, where, and which way they lie."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from roam_evaluation.goalpose.inputs.objects import EvaluationObject
from roam_evaluation.goalpose.lie import summarise
from roam_evaluation.goalpose.lying import LyingRun, judge_lying, lying_run_from, support_gaps
from roam_goalpose.objects import load_shape
from roam_goalpose.references.pairs import ReferencePair, load_reference
from roam_goalpose.synthesis import GoalPoseResult

REFERENCES = Path(__file__).parents[2] / "examples" / "references"


@pytest.fixture(scope="module")
def bed() -> ReferencePair:
    return load_reference(REFERENCES / "bed_lie.json")


def judged(bed: ReferencePair, *, turn: float = 0.0, lift: float = 0.0, seat: float | None = None) -> LyingRun:
    pose = bed.pose.turned(turn).moved(np.array([0.0, lift, 0.0]))
    result = GoalPoseResult(
        name="",
        pose=pose,
        energies={},
        diagnostics={"seat_height": 0.5},
        warnings=(),
        reference="bed_lie",
        action="lie",
        floor_height=0.0,
        object="",
        seconds=0.0,
        candidates=(),
    )
    item = EvaluationObject(Path("bed.glb"), "bed", "", seat)
    return judge_lying(item, bed.shape, result, cpu_seconds=0.0)


def test_the_reference_lies_well(bed: ReferencePair) -> None:
    run = judged(bed)
    assert run.success
    assert lying_run_from(json.loads(json.dumps(run.record()))).line().startswith("GOOD")


@pytest.mark.parametrize(
    ("change", "wrong"), [({"lift": 0.2}, "held"), ({"seat": 0.2}, "off_seat"), ({"turn": 1.5}, "")]
)
def test_who_floats_lies_on_the_back_rest_or_across_is_no_success(
    bed: ReferencePair, change: dict[str, float], wrong: str
) -> None:
    run = judged(bed, **change)
    assert not run.success
    assert run.held == (wrong != "held" and run.held)


def test_feet_on_the_pillow_are_no_success_where_there_is_a_head_board(bed: ReferencePair) -> None:
    mattress = trimesh.creation.box((1.4, 0.5, 2.1), trimesh.transformations.translation_matrix((0, 0.25, 0)))
    board = trimesh.creation.box((1.4, 1.0, 0.06), trimesh.transformations.translation_matrix((0, 0.5, -1.08)))
    shape = load_shape((mattress + board).export(file_type="glb"), "glb")
    joints = bed.pose.positions()
    trunk = joints[bed.pose.skeleton.index("neck")] - joints[0]
    away = np.arctan2(-trunk[0], -trunk[2])  # the turn that takes the head to −Z
    for turn, right in ((-away, True), (np.pi - away, False)):
        run = judged(replace(bed, source=shape), turn=float(turn))
        assert run.head_at_back is right
        assert run.across == pytest.approx(0.0, abs=0.1)


def test_gaps_are_measured_downwards(bed: ReferencePair) -> None:
    lifted = support_gaps(bed.pose.moved(np.array([0.0, 0.12, 0.0])), bed.shape)
    assert lifted["hips"] == pytest.approx(0.12, abs=0.03)


def test_silent_failures_are_counted(bed: ReferencePair) -> None:
    good, bad = judged(bed), judged(bed, lift=0.2)
    refused = replace(bad, warnings=("NO_PLAUSIBLE_POSE",))
    found = summarise(run.record() for run in (good, bad, refused))["all"]
    assert found["success"] == found["silent"] == found["refused"] == pytest.approx(1 / 3, abs=1e-4)
