"""Outlines of furniture on their way from a control to the walker's goal."""

from base64 import b64encode

import numpy as np
import pytest
from roam.v1 import motion_pb2, skeleton_pb2
from roam_character.skeleton import humanoid_skeleton
from roam_character.wire import pack_float32
from roam_motion.api.messages import control_request
from roam_motion.api.schemas import ControlJson
from roam_serving.errors import ServiceError
from standing import seated_pose

SKELETON = humanoid_skeleton()
SQUARE = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]


def goal_with(*outlines, volume=None):
    pose = seated_pose()
    message = skeleton_pb2.Pose(root_position=pack_float32(pose.root_position), rotations=pack_float32(pose.rotations))
    obstacles = [skeleton_pb2.Outline(corners=corners) for corners in outlines]
    goal = motion_pb2.Goal(pose=message, action=skeleton_pb2.ACTION_SIT, obstacles=obstacles, volume=volume)
    return motion_pb2.ControlInput(goal=goal)


def test_outlines_become_the_goals_obstacles():
    change = control_request(goal_with(SQUARE, [*SQUARE[:6]]), SKELETON).change
    assert change.intent.obstacles[0] == ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    assert len(change.intent.obstacles[1]) == 3


@pytest.mark.parametrize(
    "corners", [[0.0, 0.0, 1.0, 0.0], [*SQUARE, 2.0], [0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0], [float("nan")] * 6]
)
def test_what_is_no_polygon_is_refused_by_name(corners):
    with pytest.raises(ServiceError) as error:
        control_request(goal_with(SQUARE, corners), SKELETON)
    assert error.value.field == "control.goal.obstacles[1]"


def test_json_carries_corner_pairs():
    pose = seated_pose()
    goal = {
        "pose": {"root_position": pose.root_position.tolist(), "rotations": pose.rotations.tolist()},
        "obstacles": [[[0, 0], [1, 0], [1, 1]]],
    }
    change = ControlJson.model_validate({"goal": goal}).request(SKELETON).change
    assert change.intent.obstacles == (((0, 0), (1, 0), (1, 1)),)


def grid(**changes):
    values = np.arange(24, dtype=np.int8)
    return skeleton_pb2.Volume(
        **({"origin": [1, 2, 3], "pitch": 0.04, "yaw": 0.5, "size": [2, 3, 4], "values": values.tobytes()} | changes)
    )


def test_a_volume_comes_with_its_floor_at_zero():
    change = control_request(goal_with(volume=grid()), SKELETON).change
    volume = change.lowered(floor_height=0.25).intent.volume
    np.testing.assert_allclose(volume.origin, [1, 1.75, 3])
    assert volume.values.shape == (2, 3, 4)
    assert volume.values[1, 2, 3] == 23


@pytest.mark.parametrize(
    "changes",
    [{"size": [2, 3]}, {"size": [2, 3, 5]}, {"origin": [0, 0]}, {"pitch": 0.0}, {"yaw": float("nan")}, {"values": b""}],
)
def test_what_is_no_volume_is_refused_by_name(changes):
    with pytest.raises(ServiceError) as error:
        control_request(goal_with(volume=grid(**changes)), SKELETON)
    assert error.value.field == "control.goal.volume"


def test_json_carries_volumes_in_base64():
    pose, sent = seated_pose(), grid()
    goal = {
        "pose": {"root_position": pose.root_position.tolist(), "rotations": pose.rotations.tolist()},
        "volume": {"origin": [1, 2, 3], "pitch": 0.04, "yaw": 0.5, "size": [2, 3, 4],
                   "values": b64encode(sent.values).decode()},
    }  # fmt: skip
    by_json = ControlJson.model_validate({"goal": goal}).request(SKELETON).change.intent.volume
    by_protobuf = control_request(goal_with(volume=sent), SKELETON).change.intent.volume
    assert by_json.packed == by_protobuf.packed
