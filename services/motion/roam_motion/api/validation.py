"""What clients send becomes the domain's own types here, checked once for every transport.

Metres, radians, quaternions xyzw. Errors name the protocol's field.
"""

from collections.abc import Sequence

import numpy as np
from roam_character.pose import Pose
from roam_character.skeleton import Skeleton
from roam_character.volume import Volume
from roam_serving.endpoints.skeletons import SKELETON_NOT_FOUND
from roam_serving.errors import INVALID_ARGUMENT, ServiceError
from shapely.geometry import Polygon

from roam_motion.actions import Action
from roam_motion.control.actions import GOAL_ACTIONS
from roam_motion.control.intent import Idle, Steer
from roam_motion.control.paths import Outline
from roam_motion.errors import GOAL_INVALID

_FASTEST = 10.0  # [m/s] a steered character; sprinters reach 12, so anything above is a unit error
_FARTHEST = 1e4  # [m] from the origin; float32 still resolves a millimetre there
_LONGEST_NAME = 256  # characters
_MOST_CONTROLS = 1 << 63  # of a session; the protocol's number has 64 bits, and the next one must fit
_MOST_OBSTACLES, _MOST_CORNERS = 64, 128  # of a goal, of an outline


def control_id(number: int) -> int:
    """A control's id; INVALID_ARGUMENT where no further one could follow."""
    if not 0 <= number < _MOST_CONTROLS:
        raise ServiceError(INVALID_ARGUMENT, "count controls 1, 2, 3, …", field="control.control_id")
    return number


def event_id(text: str) -> int:
    """The sequence in a Last-Event-ID header, 0 where it is empty; INVALID_ARGUMENT when it is not one of ours."""
    if not text.strip():
        return 0
    if not text.isascii() or not text.isdigit() or int(text) >= 1 << 32:
        detail = "must be the sequence of a frame, as events carry it"
        raise ServiceError(INVALID_ARGUMENT, detail, field="last-event-id")
    return int(text)


def short(text: str, field: str) -> str:
    """A name of the client's own; INVALID_ARGUMENT when it is too long to be repeated in events."""
    if len(text) > _LONGEST_NAME:
        detail = f"at most {_LONGEST_NAME} characters, not {len(text):,}"
        raise ServiceError(INVALID_ARGUMENT, detail, field=field)
    return text


def finite(value: float, field: str) -> float:
    """A number of metres or radians; INVALID_ARGUMENT when it is none, or far from everything."""
    if not np.isfinite(value) or abs(value) > _FARTHEST:
        detail = f"{field} must be a number of metres or radians below {_FARTHEST:g}"
        raise ServiceError(INVALID_ARGUMENT, detail, field=field)
    return value


def pose(skeleton: Skeleton, skeleton_id: str, position: np.ndarray, rotations: np.ndarray, *, field: str) -> Pose:
    """A pose of `skeleton`: position [3] [m], local rotations [J, 4] xyzw.

    GOAL_INVALID or SKELETON_NOT_FOUND when the arrays do not fit it.
    """
    if skeleton_id not in ("", skeleton.id):
        detail = f"the session animates {skeleton.id}, the pose is of {skeleton_id}"
        raise ServiceError(SKELETON_NOT_FOUND, detail, field=f"{field}.skeleton_id")
    for coordinate in np.ravel(position).tolist():
        finite(coordinate, f"{field}.root_position")
    try:
        found = Pose(skeleton, position, rotations)
    except ValueError as error:
        raise ServiceError(GOAL_INVALID, f"{field}: {error}", field=field) from error
    lengths = np.linalg.norm(rotations, axis=-1, keepdims=True)
    if np.abs(lengths - 1).max() > 0.01:
        raise ServiceError(GOAL_INVALID, f"{field}.rotations are not unit quaternions", field=f"{field}.rotations")
    return Pose(skeleton, found.root_position, (rotations / lengths).astype(np.float32))


def point(place: Sequence[float], field: str) -> np.ndarray:
    """A place [3] in the client's world [m]; INVALID_ARGUMENT when it is none."""
    return np.array([finite(float(np.float32(coordinate)), field) for coordinate in place], np.float32)


def steer(
    velocity: tuple[float, float], facing: float | None, look_at: np.ndarray | None = None, *, stand: bool = False
) -> Steer | Idle:
    """Steering by hand: velocity x, z [m/s], heading [rad]; idle where it asks to `stand` or for nothing."""
    wanted = np.array(velocity, np.float32)
    heading = None if facing is None else direction(facing, "control.steer.facing")
    if not np.isfinite(wanted).all() or np.linalg.norm(wanted) > _FASTEST:
        detail = f"velocity must be finite and at most {_FASTEST:g} m/s"
        raise ServiceError(INVALID_ARGUMENT, detail, field="control.steer.velocity_x")
    still = not wanted.any() and heading is None
    return Idle(look_at) if stand or still else Steer(wanted, heading, look_at=look_at)


def goal_action(action: Action | None) -> Action:
    """An action that takes a goal pose; GOAL_INVALID for any other."""
    if action is None or action.name not in GOAL_ACTIONS:
        names = " or ".join(name.upper() for name in GOAL_ACTIONS)
        raise ServiceError(GOAL_INVALID, f"action must be {names}", field="control.goal.action")
    return action


def volume(origin: Sequence[float], pitch: float, yaw: float, size: Sequence[int], values: bytes) -> Volume:
    """The furniture of a goal: node spacing `pitch` [m], one byte for each of `size` [3] nodes."""
    field = "control.goal.volume"
    if len(size) != 3 or np.prod([float(n) for n in size]) != len(values):
        detail = f"size must be three node counts, values one byte a node; {len(values)} bytes are given"
        raise ServiceError(GOAL_INVALID, detail, field=field)
    nodes = np.frombuffer(values, np.int8).reshape(tuple(size))
    try:
        return Volume(np.array(origin, np.float32), float(np.float32(pitch)), float(np.float32(yaw)), nodes)
    except ValueError as error:
        raise ServiceError(GOAL_INVALID, str(error), field=field) from error


def obstacles(outlines: Sequence[Sequence[float]]) -> tuple[Outline, ...]:
    """Outlines of furniture, each x, z of its corners one behind the other [m]."""
    field = "control.goal.obstacles"
    if len(outlines) > _MOST_OBSTACLES:
        raise ServiceError(GOAL_INVALID, f"at most {_MOST_OBSTACLES} outlines, not {len(outlines)}", field=field)
    return tuple(_outline(corners, f"{field}[{number}]") for number, corners in enumerate(outlines))


def _outline(corners: Sequence[float], field: str) -> Outline:
    if len(corners) % 2 or not 6 <= len(corners) <= 2 * _MOST_CORNERS:
        detail = f"an outline is x, z of 3 to {_MOST_CORNERS} corners; {len(corners)} numbers are given"
        raise ServiceError(GOAL_INVALID, detail, field=field)
    numbers = np.array(corners, np.float32).tolist()
    outline = tuple(zip(numbers[::2], numbers[1::2], strict=True))
    if not np.isfinite(outline).all() or np.abs(outline).max() > _FARTHEST or not Polygon(outline).is_valid:
        detail = "an outline's corners must be finite, in metres, and its sides must not cross"
        raise ServiceError(GOAL_INVALID, detail, field=field)
    return outline


def direction(yaw: float, field: str) -> np.ndarray:
    """The direction (x, z) of a heading [rad]."""
    if not np.isfinite(yaw):
        raise ServiceError(INVALID_ARGUMENT, "must be a finite angle in radians", field=field)
    heading = float(np.float32(yaw))
    return np.array([np.sin(heading), np.cos(heading)], np.float32)
