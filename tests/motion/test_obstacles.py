"""Outlines of furniture on their way from a control to the walker's goal."""

from types import SimpleNamespace

import pytest
from character.skeleton import humanoid_skeleton
from character.wire import pack_float32
from motion.messages import control_change
from motion.schemas import ControlJson
from roam.v1 import motion_pb2, skeleton_pb2
from serving.errors import ServiceError
from standing import seated_pose

SESSION = SimpleNamespace(skeleton=humanoid_skeleton(), floor_height=0.0)
SQUARE = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]


def goal_with(*outlines):
    pose = seated_pose()
    message = skeleton_pb2.Pose(root_position=pack_float32(pose.root_position), rotations=pack_float32(pose.rotations))
    obstacles = [skeleton_pb2.Outline(corners=corners) for corners in outlines]
    goal = motion_pb2.Goal(pose=message, action=skeleton_pb2.ACTION_SIT, obstacles=obstacles)
    return motion_pb2.ControlInput(goal=goal)


def test_outlines_become_the_goals_obstacles():
    change = control_change(goal_with(SQUARE, [*SQUARE[:6]]), SESSION)
    assert change.intent.obstacles[0] == ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    assert len(change.intent.obstacles[1]) == 3


@pytest.mark.parametrize(
    "corners", [[0.0, 0.0, 1.0, 0.0], [*SQUARE, 2.0], [0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0], [float("nan")] * 6]
)
def test_what_is_no_polygon_is_refused_by_name(corners):
    with pytest.raises(ServiceError) as error:
        control_change(goal_with(SQUARE, corners), SESSION)
    assert error.value.field == "control.goal.obstacles[1]"


def test_json_carries_corner_pairs():
    pose = seated_pose()
    goal = {
        "pose": {"root_position": pose.root_position.tolist(), "rotations": pose.rotations.tolist()},
        "obstacles": [[[0, 0], [1, 0], [1, 1]]],
    }
    message = ControlJson.model_validate({"goal": goal}).message()
    assert list(message.goal.obstacles[0].corners) == [0, 0, 1, 0, 1, 1]
