"""Intents that a client sends to a session."""

from roam.v1 import motion_pb2

from roam_client.types.actions import Action
from roam_client.types.goal_poses import GoalPose


def steer(
    velocity_x: float = 0.0,
    velocity_z: float = 0.0,
    *,
    facing: float | None = None,
    action: Action = Action.UNSPECIFIED,
    look_at: tuple[float, float, float] | None = None,
) -> motion_pb2.ControlInput:
    """Walk by hand: velocity on the ground [m/s], facing about +Y [rad] or where it walks. Ends sitting and lying.

    `look_at`: a place in the world [m] that the eyes turn to.
    """
    return motion_pb2.ControlInput(
        steer=motion_pb2.Steer(
            velocity_x=velocity_x,
            velocity_z=velocity_z,
            facing=facing,
            action=action.message,
            look_at=_point(look_at),
        )
    )


def _point(place: tuple[float, float, float] | None) -> motion_pb2.Point | None:
    return None if place is None else motion_pb2.Point(x=place[0], y=place[1], z=place[2])


def stand_up() -> motion_pb2.ControlInput:
    """Leave the goal and stand."""
    return steer(action=Action.IDLE)


def go_to(goal: GoalPose, *, look_at: tuple[float, float, float] | None = None) -> motion_pb2.ControlInput:
    """Walk to a goal pose and settle into it; `look_at`: a place in the world [m] that the eyes turn to."""
    control = motion_pb2.ControlInput(goal=goal.goal_message)
    if look_at is not None:
        control.goal.look_at.x, control.goal.look_at.y, control.goal.look_at.z = look_at
    return control


def playback(*, paused: bool) -> motion_pb2.ControlInput:
    """Hold the current frame, or go on."""
    return motion_pb2.ControlInput(playback=motion_pb2.Playback(paused=paused))
