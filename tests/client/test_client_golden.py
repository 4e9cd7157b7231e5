"""The shared byte vectors of proto/golden, read by the client."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from roam.v1 import goal_pose_pb2, motion_pb2
from roam_client import Action, Event, EventType, Frame, GoalPose, Header, Object, Progress
from roam_client.streams.stream_state import ControlCounter, StreamState
from roam_client.types.skeleton import Skeleton

FOLDER = Path(__file__).parents[2] / "proto" / "golden"


def stored(name: str) -> tuple[bytes, dict[str, Any]]:
    return (FOLDER / f"{name}.bin").read_bytes(), json.loads((FOLDER / f"{name}.json").read_text())


def values(told: dict[str, Any], path: str) -> np.ndarray:
    return np.array(told["arrays"][path]["values"], np.float32)


def opened() -> tuple[StreamState, Header]:
    state = StreamState("sessions/1f", ControlCounter())
    header = state.receive(motion_pb2.AnimateResponse.FromString(stored("stream_header")[0]))
    assert isinstance(header, Header)
    return state, header


def test_the_header_is_read():
    state, header = opened()
    _, told = stored("stream_header")
    np.testing.assert_array_equal(header.skeleton.rest_offsets, values(told, "header.skeleton.rest_offsets"))
    assert header.skeleton.joint_names == ("hips", "spine", "head")
    assert (header.first_sequence, header.contact_joints, header.exact) == (91, (1, 2), True)
    assert state.counter.next() == 301  # after the last control that the server has
    assert state.opening().resume_token == "token"


@pytest.mark.parametrize("name", ["frame_float32", "frame_snorm16"])
def test_frames_are_read(name: str):
    state, header = opened()
    if name == "frame_float32":
        plain = motion_pb2.StreamHeader(rotation_encoding=motion_pb2.ROTATION_ENCODING_FLOAT32, contact_joints=[1, 2])
        state.header = Header.from_message(plain, known=header.skeleton)
    data, told = stored(name)
    frame = state.receive(motion_pb2.AnimateResponse.FromString(data))
    assert isinstance(frame, Frame)
    rotations = values(told, "frame.rotations") / (32767 if name == "frame_snorm16" else 1)
    np.testing.assert_allclose(frame.rotations, rotations, atol=4e-5)
    np.testing.assert_array_equal(frame.root_position, values(told, "frame.root")[:3])
    assert (frame.sequence, frame.time, frame.action, frame.goal_distance) == (90, 3.0, Action.WALK, 0.75)
    assert frame.contacts.tolist() == [True, False]
    if name == "frame_float32":
        np.testing.assert_array_equal(frame.joint_positions, values(told, "frame.joint_positions"))


def test_the_event_is_read():
    state, _ = opened()
    event = state.receive(motion_pb2.AnimateResponse.FromString(stored("event_goal_reached")[0]))
    assert event == Event(EventType.GOAL_REACHED, 195, message="there", goal_pose="goalPoses/x")


def test_the_goal_pose_its_object_and_its_progress_are_read():
    _, header = opened()
    data, told = stored("goal_pose")
    response = goal_pose_pb2.SynthesizeResponse.FromString(data)
    skeleton: Skeleton = header.skeleton
    goal = GoalPose.from_message(response.goal_pose, skeleton=skeleton, object_to_world=np.eye(4))
    np.testing.assert_array_equal(goal.rotations, values(told, "goal_pose.pose.rotations"))
    np.testing.assert_array_equal(goal.joint_positions, values(told, "goal_pose.joint_positions"))
    assert (
        goal.diagnostics == told["fields"]["goalPose" if "goalPose" in told["fields"] else "goal_pose"]["diagnostics"]
    )
    answer = goal_pose_pb2.UploadObjectResponse.FromString(stored("object")[0])
    assert Object.from_message(answer.object).object_to_world.shape == (4, 4)
    progress = goal_pose_pb2.SynthesizeResponse.FromString(stored("progress")[0]).progress
    assert Progress.from_message(progress).pose is not None
