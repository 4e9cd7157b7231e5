"""The protocol's requests as this service's own types."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from roam.v1 import goal_pose_pb2, skeleton_pb2
from roam_character.skeleton import Skeleton, Tip
from roam_character.wire import unpack_float32
from roam_serving.errors import INVALID_ARGUMENT, ServiceError

from roam_goalpose.api.messages import ACTIONS
from roam_goalpose.energy.constraints import Constraints, Point
from roam_goalpose.service.queries import GivenReference, PoseQuery

T = TypeVar("T")

HANDS = {goal_pose_pb2.HAND_LEFT: "left", goal_pose_pb2.HAND_RIGHT: "right"}
FARTHEST = 1e4  # [m] of a point, [rad] of a heading
MOST_JOINTS = 256


def query_from_message(request: goal_pose_pb2.SynthesizeRequest) -> PoseQuery:
    """A request for a goal pose; a ServiceError INVALID_ARGUMENT that names the field which cannot be meant."""
    own = request.HasField("skeleton")
    return PoseQuery(
        object=request.object,
        points=_points(request.points) if request.points else None,
        reference=request.reference_pose.removeprefix("referencePoses/"),
        action="" if request.reference_pose else action_from_message(request.action),
        initial_yaw=request.initial_yaw if request.HasField("initial_yaw") else None,
        restarts=request.restarts,
        seed=request.seed,
        solver=request.solver or "default",
        count=request.count or 1,
        constraints=_checked("constraints", lambda: constraints_from_message(request.constraints)),
        weights=tuple(sorted(request.weights.items())),
        skeleton=_checked("skeleton", lambda: skeleton_from_message(request.skeleton)) if own else None,
        skeleton_id=request.skeleton_id,
    )


def reference_from_message(request: goal_pose_pb2.CreateReferencePoseRequest) -> GivenReference:
    """A pose of the caller's own; a ServiceError INVALID_ARGUMENT for numbers that make none."""
    root, rotations = _checked("pose", lambda: _posture(request.pose))
    return GivenReference(
        object=request.object,
        action=action_from_message(request.action),
        title=request.title,
        skeleton_id=request.pose.skeleton_id,
        root_position=root,
        rotations=rotations,
    )


def action_from_message(action: int) -> str:
    """The action of a request; INVALID_ARGUMENT when it is none that poses are made for."""
    for name, number in ACTIONS.items():
        if number == action:
            return name
    names = " or ".join(name.upper() for name in ACTIONS)
    raise ServiceError(INVALID_ARGUMENT, f"name a reference_pose, or the action {names}", field="action")


def _checked(field: str, read: Callable[[], T]) -> T:
    """What `read` makes of a part of a message; its ValueError as INVALID_ARGUMENT."""
    try:
        return read()
    except ValueError as error:
        raise ServiceError(INVALID_ARGUMENT, str(error), field=field) from error


def _points(data: bytes) -> NDArray[np.float32]:
    if len(data) % 12:
        raise ServiceError(INVALID_ARGUMENT, f"{len(data)} bytes; points are float32 [N, 3]", field="points")
    return np.frombuffer(data, "<f4").reshape(-1, 3)


def _posture(message: skeleton_pb2.Pose) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Root position and rotations, normalised."""
    rotations = unpack_float32(message.rotations, (-1, 4))
    lengths = np.linalg.norm(rotations, axis=-1, keepdims=True)
    if not (lengths > 1e-6).all():
        raise ValueError("a rotation has no length; quaternions are xyzw and of unit length")
    return unpack_float32(message.root_position, (-1,)), rotations / lengths


def skeleton_from_message(message: skeleton_pb2.Skeleton) -> Skeleton:
    """A skeleton of the caller's own. Raises ValueError when its parts do not fit or its rest is turned."""
    count = len(message.joint_names)
    if not count:
        raise ValueError("it has no joints")
    if count > MOST_JOINTS:
        raise ValueError(f"{count} joints; at most {MOST_JOINTS}, fingers are not posed")
    rotations = unpack_float32(message.rest_rotations, (-1, 4))
    if len(message.humanoid_bones) != count or len(rotations) != count:
        raise ValueError(f"{count} joints need {count} humanoid_bones and rest_rotations")
    if not np.allclose(rotations, [0, 0, 0, 1], atol=1e-4):
        raise ValueError("rest_rotations must be identities: stand in a T-pose facing +Z, as VRM 1.0 does")
    if any(tip.joint >= count or len(tip.offset) != 3 for tip in message.tips):
        raise ValueError("every tip needs a joint of the skeleton and an offset of three numbers")
    offsets = unpack_float32(message.rest_offsets, (-1, 3))
    if not np.isfinite(offsets).all():
        raise ValueError("rest_offsets must be finite")
    return Skeleton(
        joint_names=tuple(message.joint_names),
        parents=tuple(message.parents),
        rest_offsets=offsets,
        rest_rotations=rotations,
        humanoid_bones=tuple(message.humanoid_bones),
        tips=tuple(Tip(tip.name, tip.joint, (tip.offset[0], tip.offset[1], tip.offset[2])) for tip in message.tips),
    )


def constraints_from_message(message: goal_pose_pb2.PoseConstraints) -> Constraints:
    """The caller's wishes. Raises ValueError for points that are none, hands that are none or are named twice."""
    hands = tuple((HANDS.get(t.hand, ""), _point(t.position, "hand_targets")) for t in message.hand_targets)
    names = [hand for hand, _ in hands]
    if "" in names or len(set(names)) < len(names):
        raise ValueError("hand_targets: name each hand, LEFT or RIGHT, at most once")
    facing = message.facing if message.HasField("facing") else None
    if facing is not None and not abs(facing) < FARTHEST:
        raise ValueError("facing must be an angle in radians")
    seat = _point(message.seat_point, "seat_point") if message.seat_point else None
    return Constraints(seat_point=seat, facing=facing, hands=hands)


def _point(values: Sequence[float], name: str) -> Point:
    if len(values) != 3 or not np.isfinite(values).all() or np.abs(values).max() > FARTHEST:
        raise ValueError(f"{name}: a point is three numbers x, y, z in metres")
    return values[0], values[1], values[2]
