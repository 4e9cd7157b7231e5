import numpy as np
import pytest
import trimesh
from box_furniture import box
from roam_character.rotation import quat_from_yaw, quat_rotate
from roam_goalpose.assessment.diagnostics import warn
from roam_goalpose.objects import load_shape
from roam_goalpose.solvers.paper import PaperConfig
from roam_goalpose.solvers.progress import Cancelled
from roam_goalpose.synthesis import GoalPoseRequest, RequestError, Synthesizer, SynthesizerSettings
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
    assert other.pose.rotations.tobytes() == first.pose.rotations.tobytes()  # it looks at every heading anyhow


def test_the_action_chooses_the_reference_by_fit(synthesizer):
    assert synthesizer.synthesize(pair("stool_sit").shape, GoalPoseRequest(action="sit")).reference == "stool_sit"
    assert synthesizer.synthesize(pair("chair_sit").shape, GoalPoseRequest(action="sit")).reference == "chair_sit"


def test_lying_across_the_top_of_a_back_rest_is_reported(synthesizer):
    values = synthesizer.synthesize(pair("sofa_lie").shape, GoalPoseRequest(action="lie")).diagnostics
    assert warn(values) == ()
    perched = warn(values | {"contacts_met": 0.5})  # a two-seater 1.5 m wide, without the legs' support
    assert [warning.reason for warning in perched] == ["NO_PLAUSIBLE_POSE"]
    assert warn(values | {"contacts_met": 0.5, "trunk_rise": 0.45}) == ()
    on_top = warn(values | {"seat_breadth": 0.2})  # of a back rest as broad as that, on which all contacts may be met
    assert [warning.reason for warning in on_top] == ["NO_PLAUSIBLE_POSE"]


def test_lying_on_a_sofa_stays_on_the_sofa(synthesizer):
    result = synthesizer.synthesize(pair("sofa_lie").shape, GoalPoseRequest(action="lie"))
    assert result.reference == "sofa_lie"
    assert result.diagnostics["support_miss"] < 0.02
    assert "floor_distance" not in result.diagnostics


def test_a_dining_table_high_bar_seat_is_reported(synthesizer):
    result = synthesizer.synthesize(pair("bar_sit").shape, GoalPoseRequest(reference="stool_sit"))
    assert "FEET_OFF_FLOOR" in [w.reason for w in result.warnings]
    assert result.diagnostics["floor_reach"] == pytest.approx(0.29, abs=0.03)


def test_the_published_solver_runs(synthesizer):
    result = synthesizer.synthesize(pair("chair_sit").shape, GoalPoseRequest(reference="chair_sit", solver="paper"))
    assert set(result.energies) == {"descriptor", "angle_limit", "floor", "prior", "total"}


def turned_file(name: str, yaw: float, offset: np.ndarray) -> bytes:
    """The object of a reference pair, turned about +Y and moved."""
    vertices, faces = pair(name).shape.mesh
    turn = np.broadcast_to(quat_from_yaw(np.array(yaw)), (len(vertices), 4))
    moved = quat_rotate(turn, vertices.astype(np.float64)) + offset
    return trimesh.Trimesh(moved, faces, process=False).export(file_type="ply")


@pytest.mark.parametrize("name", ["office_sit", "sofa_sit", "stool_sit", "bench_sit"])
@pytest.mark.parametrize("yaw", [1.1, -2.6])
def test_turning_and_moving_the_upload_turns_and_moves_the_pose(synthesizer, name, yaw):
    offset = np.array([2.0, 0.3, -1.0])
    request = GoalPoseRequest(reference="chair_sit", initial_yaw=0.0)
    still = synthesizer.synthesize(pair(name).shape, request).pose
    turned = synthesizer.synthesize(load_shape(turned_file(name, yaw, offset), "ply", unit="m", up="y"), request).pose
    apart = turned.positions() - (still.turned(yaw).positions() + offset)
    assert np.linalg.norm(apart, axis=-1).max() < 0.01


def test_a_bench_offers_several_places(synthesizer):
    result = synthesizer.synthesize(pair("bench_sit").shape, GoalPoseRequest(reference="stool_sit", count=2))
    assert len(result.poses) == 2
    assert result.poses[0].pose is result.pose
    hips = np.stack([found.pose.root_position for found in result.poses])
    apart = np.linalg.norm(hips[:, None] - hips[None], axis=-1)
    assert apart[0, 1] > 0.3
    for found in result.poses:
        assert found.place[1] == pytest.approx(0.45, abs=0.02)


def test_progress_is_told_in_the_world(synthesizer):
    told = []
    offset = np.array([5.0, 0.0, 5.0])
    shape = load_shape(turned_file("office_sit", 0.5, offset), "ply", unit="m", up="y")
    synthesizer.synthesize(shape, GoalPoseRequest(reference="chair_sit"), progress=told.append)
    assert np.linalg.norm((told[-1].pose.root_position - offset)[[0, 2]]) < 0.6


TABLE = [
    box(np.array([-0.8, 0.74, -0.4]), np.array([0.8, 0.78, 0.4])),
    *(box(np.array([x, 0.0, z]), np.array([x + 0.05, 0.75, z + 0.05])) for x in (-0.78, 0.73) for z in (-0.38, 0.33)),
]


RIM = trimesh.creation.annulus(
    0.27, 0.30, 0.5, transform=trimesh.transformations.rotation_matrix(0.5 * np.pi, [1, 0, 0])
).apply_translation([0.0, 0.25, 0.0])
PERCH = trimesh.util.concatenate(
    [
        box(np.array([-0.18, 0.68, -0.18]), np.array([0.18, 0.72, 0.18])),
        *(
            box(np.array([x, 0.0, z]), np.array([x + 0.03, 0.7, z + 0.03]))
            for x in (-0.18, 0.15)
            for z in (-0.18, 0.15)
        ),
    ]
)


@pytest.mark.parametrize(
    "mesh",
    [
        pytest.param(trimesh.util.concatenate(TABLE), id="table"),
        pytest.param(box(np.array([-0.5, 0.0, -0.3]), np.array([0.5, 2.0, 0.3])), id="wardrobe"),
        pytest.param(box(np.array([-0.05, 0.0, -0.05]), np.array([0.05, 1.6, 0.05])), id="post"),
        *(
            pytest.param(box(np.array([-0.5, 0.0, -0.3]), np.array([0.5, high, 0.3])), id=f"doorstep of {high} m")
            for high in (0.12, 0.14, 0.18)
        ),
        pytest.param(RIM, id="rim of a barrel"),
    ],
)
def test_nobody_sits_on_what_is_no_seat(synthesizer, mesh):
    result = synthesizer.synthesize(load_shape(mesh.export(file_type="glb"), "glb"), GoalPoseRequest())
    assert result.warnings[0].reason == "NO_PLAUSIBLE_POSE"


def test_a_bar_stool_without_a_back_is_a_seat_from_which_feet_hang(synthesizer):
    result = synthesizer.synthesize(load_shape(PERCH.export(file_type="glb"), "glb"), GoalPoseRequest())
    assert [warning.reason for warning in result.warnings] == ["FEET_OFF_FLOOR"]
    assert result.diagnostics["seat_height"] == pytest.approx(0.72, abs=0.02)
    assert result.diagnostics["seat_area"] == pytest.approx(0.42**2, abs=0.06)  # the slack for slats on either side


def slab(width: float, depth: float, height: float) -> trimesh.Trimesh:
    """A board on four legs."""
    x, z = np.array([-width, width - 0.1]) / 2, np.array([-depth, depth - 0.1]) / 2
    legs = [box(np.array([a, 0.0, b]), np.array([a + 0.05, height, b + 0.05])) for a in x for b in z]
    top = box(np.array([-width / 2, height - 0.04, -depth / 2]), np.array([width / 2, height, depth / 2]))
    return trimesh.util.concatenate([top, *legs])


def rail(width: float) -> trimesh.Trimesh:
    """A beam at sitting height on two posts that are wider than it."""
    posts = [box(np.array([x, 0.0, -0.2]), np.array([x + 0.1, 0.4, 0.2])) for x in (-0.8, 0.7)]
    beam = box(np.array([-0.8, 0.38, -width / 2]), np.array([0.8, 0.45, width / 2]))
    return trimesh.util.concatenate([beam, *posts])


def ball(radius: float) -> trimesh.Trimesh:
    """A ball on the floor."""
    return trimesh.creation.icosphere(4, radius).apply_translation([0.0, radius, 0.0])


@pytest.mark.parametrize(
    ("mesh", "reasons"),
    [
        pytest.param(slab(1.1, 0.6, 0.32), ["TABLE_LIKE_SEAT"], id="coffee table"),
        pytest.param(slab(1.1, 0.6, 0.45), ["TABLE_LIKE_SEAT"], id="higher coffee table"),
        pytest.param(slab(1.0, 0.45, 0.4), ["TABLE_LIKE_SEAT"], id="small coffee table, or a deep bench"),
        pytest.param(slab(1.1, 0.36, 0.33), ["TABLE_LIKE_SEAT"], id="low coffee table"),
        pytest.param(slab(1.2, 0.38, 0.45), [], id="bench"),
        pytest.param(slab(0.4, 0.4, 0.45), [], id="stool"),
        pytest.param(ball(0.275), ["UNSTEADY_SEAT"], id="ball"),
        pytest.param(ball(0.325), ["UNSTEADY_SEAT"], id="larger ball"),
        pytest.param(rail(0.06), ["NO_PLAUSIBLE_POSE"], id="rail"),
        pytest.param(rail(0.13), ["NARROW_SEAT"], id="beam"),
    ],
)
def test_a_poor_seat_is_called_one(synthesizer, mesh, reasons):
    result = synthesizer.synthesize(load_shape(mesh.export(file_type="glb"), "glb"), GoalPoseRequest())
    assert [w.reason for w in result.warnings if w.reason != "FEET_OFF_FLOOR"] == reasons


def test_who_lies_is_not_asked_for_a_seat(synthesizer):
    values = synthesizer.synthesize(pair("sofa_lie").shape, GoalPoseRequest(action="lie")).diagnostics
    assert warn(values | {"seat_breadth": 2.0, "lean_miss": 1.0, "base_breadth": 0.0}) == ()


@pytest.mark.parametrize("name", ["chair_sit", "office_sit", "stool_sit", "bench_sit", "sofa_sit"])
def test_seats_raise_no_alarm(synthesizer, name):
    result = synthesizer.synthesize(pair(name).shape, GoalPoseRequest(reference="chair_sit"))
    assert result.warnings == ()
    assert result.diagnostics["floor_reach"] < 0.03
    assert max(result.poses[0].bone_depths.values()) == pytest.approx(result.diagnostics["penetration_depth"])


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
