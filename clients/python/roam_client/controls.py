"""Intents that a client sends to a session."""

from roam.v1 import motion_pb2

from roam_client.actions import Action
from roam_client.goal_poses import GoalPose


def steer(
    velocity_x: float = 0.0,
    velocity_z: float = 0.0,
    *,
    facing: float | None = None,
    action: Action = Action.UNSPECIFIED,
) -> motion_pb2.ControlInput:
    """Walk by hand: velocity on the ground [m/s], facing about +Y [rad] or where it walks. Ends sitting and lying."""
    return motion_pb2.ControlInput(
        steer=motion_pb2.Steer(velocity_x=velocity_x, velocity_z=velocity_z, facing=facing, action=action.message)
    )


def stand_up() -> motion_pb2.ControlInput:
    """Leave the goal and stand."""
    return steer(action=Action.IDLE)


def go_to(goal: GoalPose) -> motion_pb2.ControlInput:
    """Walk to a goal pose and settle into it."""
    return motion_pb2.ControlInput(goal=goal.goal_message)


def playback(*, paused: bool) -> motion_pb2.ControlInput:
    """Hold the current frame, or go on."""
    return motion_pb2.ControlInput(playback=motion_pb2.Playback(paused=paused))
