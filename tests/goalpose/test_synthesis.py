import pytest
from goalpose.paper_solver import PaperConfig
from goalpose.progress import Cancelled
from goalpose.synthesis import GoalPoseRequest, RequestError, Synthesizer, SynthesizerSettings
from solving import LandmarkField, pair


@pytest.fixture(scope="module")
def synthesizer():
    names = ("chair_sit", "stool_sit", "sofa_lie")
    pairs = {name: pair(name) for name in names}
    return Synthesizer(LandmarkField(), pairs, paper=PaperConfig(samples=2, scale=0.02))


def test_a_pose_on_an_unseen_chair_comes_with_measures(synthesizer):
    result = synthesizer.synthesize(pair("office_sit").shape, GoalPoseRequest(reference="chair_sit"))
    assert result.reference == "chair_sit"
    assert result.action == "sit"
    assert result.diagnostics["hip_seat_distance"] < 0.04
    assert result.diagnostics["penetration_depth"] < 0.06
    assert result.energies["total"] == pytest.approx(
        sum(v for k, v in result.energies.items() if k != "total"), rel=1e-4
    )
    assert result.candidates[0].energy == pytest.approx(result.energies["total"], rel=1e-5)


def test_the_same_request_gives_the_same_bytes_and_another_heading_another_name(synthesizer):
    shape = pair("office_sit").shape
    first, second = (synthesizer.synthesize(shape, GoalPoseRequest(reference="chair_sit")) for _ in range(2))
    assert first.name == second.name
    assert first.pose.rotations.tobytes() == second.pose.rotations.tobytes()
    assert first.pose.root_position.tobytes() == second.pose.root_position.tobytes()
    other = synthesizer.synthesize(shape, GoalPoseRequest(reference="chair_sit", initial_yaw=1.0))
    assert other.name != first.name


def test_the_action_chooses_the_reference_by_fit(synthesizer):
    assert synthesizer.synthesize(pair("stool_sit").shape, GoalPoseRequest(action="sit")).reference == "stool_sit"
    assert synthesizer.synthesize(pair("chair_sit").shape, GoalPoseRequest(action="sit")).reference == "chair_sit"


def test_lying_on_a_sofa_stays_on_the_sofa(synthesizer):
    result = synthesizer.synthesize(pair("sofa_lie").shape, GoalPoseRequest(action="lie"))
    assert result.reference == "sofa_lie"
    assert result.diagnostics["support_miss"] < 0.02
    assert "floor_distance" not in result.diagnostics


def test_a_dining_table_high_bar_seat_is_reported(synthesizer):
    result = synthesizer.synthesize(pair("bar_sit").shape, GoalPoseRequest(reference="chair_sit"))
    assert "FEET_OFF_FLOOR" in [w.reason for w in result.warnings]


def test_the_published_solver_runs(synthesizer):
    result = synthesizer.synthesize(pair("chair_sit").shape, GoalPoseRequest(reference="chair_sit", solver="paper"))
    assert set(result.energies) == {"descriptor", "angle_limit", "floor", "prior", "total"}


@pytest.mark.parametrize(
    ("request_", "field"),
    [
        (GoalPoseRequest(reference="throne"), "reference_pose"),
        (GoalPoseRequest(action="fly"), "action"),
        (GoalPoseRequest(reference="chair_sit", solver="magic"), "solver"),
    ],
)
def test_impossible_requests_name_the_field(synthesizer, request_, field):
    with pytest.raises(RequestError) as caught:
        synthesizer.synthesize(pair("chair_sit").shape, request_)
    assert caught.value.field == field


def test_cancelling_is_honoured(synthesizer):
    with pytest.raises(Cancelled):
        synthesizer.synthesize(pair("chair_sit").shape, GoalPoseRequest(), cancelled=lambda: True)


def test_missing_weights_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="roam train field"):
        Synthesizer.load(SynthesizerSettings(weights=tmp_path / "none.safetensors"))
