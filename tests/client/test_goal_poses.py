import json

import numpy as np
import pytest
from fake_services import Fake
from roam_client import Action, AsyncClient, Client, FormatError, InvalidRequestError, Pose, PoseWishes, Progress
from roam_client.types.goal_poses import synthesize_request


def test_an_upload_is_cut_into_messages_of_a_mebibyte(client: Client, fake: Fake, tmp_path):
    path = tmp_path / "chair.obj"
    path.write_bytes(bytes(5 << 19))
    chair = client.upload(path, unit="cm", up_axis="z")
    assert [len(r.chunk) for r in fake.goal_poses.uploads] == [1 << 20, 1 << 20, 1 << 19]
    assert [(r.format, r.unit, r.up_axis) for r in fake.goal_poses.uploads] == [
        ("obj", "cm", "z"),
        ("",) * 3,
        ("",) * 3,
    ]
    assert chair.name == "objects/sha256:abc"
    np.testing.assert_allclose(chair.object_to_world, np.diag([0.01, 0.01, 0.01, 1]))
    assert chair.bounds.shape == (2, 3)
    assert chair.warnings[0].reason == "UNIT_GUESSED"


def test_a_file_of_an_unknown_kind_is_refused_before_anything_is_sent(client: Client, fake: Fake, tmp_path):
    path = tmp_path / "chair.blend"
    path.write_bytes(b"x")
    with pytest.raises(FormatError, match="obj, glb"):
        client.upload(path)
    assert fake.goal_poses.uploads == []


def test_synthesis_reports_progress_and_answers_a_pose(client: Client):
    seen: list[Progress] = []
    goal = client.synthesize("objects/sha256:abc", reference="chair_sit", seed=7, on_progress=seen.append)
    assert [p.iteration for p in seen] == [0, 1, 2]
    assert seen[0].pose is None
    assert seen[1].pose is not None
    assert seen[1].pose.rotations.shape == (3, 4)
    assert goal.joint_positions.shape == (3, 3)
    assert goal.reference_pose == "referencePoses/chair_sit"
    assert goal.energies["total"] == 0.5
    assert goal.floor_height == pytest.approx(0.25)
    np.testing.assert_allclose(goal.object_to_world[0, 0], 0.01)
    np.testing.assert_allclose(
        goal.skeleton.joint_positions(goal.root_position, goal.rotations), goal.joint_positions, atol=1e-6
    )


def test_the_request_says_what_was_asked(client: Client, fake: Fake):
    client.synthesize("objects/sha256:abc", action=Action.LIE, restarts=4, seed=9, initial_yaw=0.5, solver="paper")
    request = fake.goal_poses.requests[-1]
    assert (request.action, request.restarts, request.seed, request.solver) == (Action.LIE, 4, 9, "paper")
    assert request.initial_yaw == 0.5
    assert request.reference_pose == ""
    assert not synthesize_request("x").HasField("initial_yaw")


def test_a_pose_saves_as_npz_and_json_with_the_promised_names(client: Client, tmp_path):
    goal = client.synthesize("objects/sha256:abc")
    goal.save(tmp_path / "pose.npz")
    with np.load(tmp_path / "pose.npz", allow_pickle=False) as file:
        shapes = {name: file[name].shape for name in file.files}
        assert json.loads(str(file["metadata"]))["energies"] == {"descriptor": 0.5, "total": 0.5}
    promised = {
        "joint_names": (3,),
        "parents": (3,),
        "root_position": (3,),
        "rotations": (3, 4),
        "joint_positions": (3, 3),
        "object_to_world": (4, 4),
    }
    assert promised.items() <= shapes.items()
    goal.save(tmp_path / "pose.json")
    read = json.loads((tmp_path / "pose.json").read_text())
    np.testing.assert_allclose(read["joint_positions"], goal.joint_positions)
    assert read["diagnostics"]["hip_seat_distance"] == pytest.approx(0.03)
    with pytest.raises(FormatError, match="roam command"):
        goal.save(tmp_path / "pose.glb")


def test_reference_poses_come_with_points_only_when_asked(client: Client):
    (bare,) = client.reference_poses()
    (full,) = client.reference_poses(include_points=True)
    assert (bare.id, bare.title, bare.action) == ("chair_sit", "Sitting on a chair", Action.SIT)
    assert bare.object_points is None
    assert full.object_points is not None
    assert full.object_points.shape == (4, 3)


def test_a_skeleton_comes_with_its_body_and_is_asked_for_once(client: Client):
    skeleton = client.skeleton()
    assert skeleton is client.skeleton()
    assert skeleton.joint_names == ("hips", "spine", "head")
    assert skeleton.body[0].radius == pytest.approx(0.1)
    assert client.server_info("motion").limits == {"max_sessions": 9}


async def test_the_async_twin_answers_the_same(fake: Fake, client: Client):
    async with AsyncClient(goalpose=fake.address, motion=fake.address) as twin:
        chair = await twin.upload(b"v", format="obj")
        seen: list[Progress] = []
        goal = await twin.synthesize(chair, on_progress=seen.append)
        assert len(seen) == 3
        assert (await twin.server_info("goalpose")).version == "0.0"
        assert len(await twin.reference_poses()) == 1
    same = client.synthesize(client.upload(b"v", format="obj"))
    np.testing.assert_array_equal(goal.joint_positions, same.joint_positions)


def test_wishes_travel_with_the_request(client: Client, fake: Fake):
    wishes = PoseWishes(seat_point=(1, 2, 3), facing=0.5, right_hand=(4, 5, 6), weights={"prior": 0.0})
    client.synthesize("objects/sha256:abc", wishes=wishes, count=3)
    request = fake.goal_poses.requests[-1]
    assert (list(request.constraints.seat_point), request.constraints.facing) == ([1, 2, 3], 0.5)
    assert [(t.hand, list(t.position)) for t in request.constraints.hand_targets] == [(2, [4, 5, 6])]
    assert (dict(request.weights), request.count) == ({"prior": 0.0}, 3)
    assert not synthesize_request("x").constraints.HasField("facing")


def test_alternatives_are_goal_poses_of_the_same_object(client: Client):
    goal = client.synthesize("objects/sha256:abc", count=3)
    assert [float(other.root_position[0]) for other in goal.alternatives] == [0.5, 1.0]
    for other in goal.alternatives:
        assert (other.object, other.floor_height) == (goal.object, goal.floor_height)
    assert goal.quality.bone_penetrations[0].bone == "hips"
    assert goal.quality.descriptor_residual is None
    assert goal.quality.floor_distance == 0.0
    assert goal.place == pytest.approx((0, 0.65, 0.1))


def test_a_taller_person_comes_back_with_their_own_skeleton(client: Client, fake: Fake):
    tall = client.skeleton().sized(1.25)
    goal = client.synthesize("objects/sha256:abc", wishes=PoseWishes(skeleton=tall))
    np.testing.assert_allclose(goal.skeleton.rest_offsets, 1.25 * client.skeleton().rest_offsets, rtol=1e-6)
    assert fake.goal_poses.requests[-1].skeleton.id == ""


def test_unknown_terms_are_refused_by_field(client: Client):
    with pytest.raises(InvalidRequestError) as caught:
        client.synthesize("objects/sha256:abc", wishes=PoseWishes(weights={"charm": 1.0}))
    assert caught.value.fields[0].field == "weights"


async def test_a_pose_of_ones_own_becomes_a_reference(client: Client, fake: Fake):
    goal = client.synthesize("objects/sha256:abc")
    own = Pose("", goal.root_position, goal.rotations)
    made = client.create_reference("objects/sha256:abc", own, action=Action.LIE, title="mine")
    assert (made.name, made.action, made.title) == ("referencePoses/sha256:own", Action.LIE, "mine")
    async with AsyncClient(goalpose=fake.address) as other:
        await other.create_reference("objects/sha256:abc", own)
    assert [request.action for request in fake.goal_poses.created] == [Action.LIE, Action.SIT]
    client.synthesize("objects/sha256:abc", reference=made.id)
    assert fake.goal_poses.requests[-1].reference_pose == made.name
