"""Poses authored by hand: a trunk from joint angles, arms and legs from where hands and feet go.

Every pose is made here from a few numbers that a person chose by looking; no motion capture is involved.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from roam_character.kinematics import forward_kinematics, local_rotations
from roam_character.pose import Pose
from roam_character.rotation import quat_from_axes, quat_from_rotvec, quat_mul, quat_rotate
from roam_character.skeleton import Skeleton

Array = npt.NDArray[np.float64]
TRUNK = ("hips", "spine", "chest", "upperChest", "neck", "head")
SIDES = {"left": 1.0, "right": -1.0}


@dataclass(frozen=True, kw_only=True)
class LimbGoal:
    """Where the end of an arm or leg goes, and which way its middle joint and its end point."""

    end: tuple[float, float, float]  # wrist or ankle joint, world [m]; x is mirrored for the right side
    pole: tuple[float, float, float]  # side towards which the elbow or knee points
    direction: tuple[float, float, float]  # of the fingers or toes
    normal: tuple[float, float, float] = (0.0, 1.0, 0.0)  # of the back of the hand or the top of the foot


def author_pose(
    skeleton: Skeleton,
    *,
    root: tuple[float, float, float],
    facing: Array,
    pitches: Mapping[str, float],
    arms: LimbGoal | tuple[LimbGoal, LimbGoal],
    legs: LimbGoal | tuple[LimbGoal, LimbGoal],
) -> Pose:
    """A pose from the hips' position [m], the trunk's frame, forward pitches [degrees] and limb goals (left, or left
    and right).

    `facing` [4]: orientation of the figure before its own pitches; identity sits upright facing +Z. Limb goals are in
    the world frame. One goal serves both sides, mirrored in x (or, for a lying figure, give two).
    """
    orientations = np.tile(np.array(facing, np.float64), (skeleton.joint_count, 1))
    turn = np.array(facing, np.float64)
    for name in TRUNK:
        turn = quat_mul(turn, quat_from_rotvec(np.array([np.radians(pitches.get(name, 0.0)), 0.0, 0.0])))
        orientations[skeleton.index(name)] = turn
    for side in SIDES:
        orientations[skeleton.index(f"{side}Shoulder")] = orientations[skeleton.index("upperChest")]
    for side, goal in _both(arms):
        _place_arm(skeleton, np.array(root), orientations, side, goal)
    for side, goal in _both(legs):
        _place_leg(skeleton, np.array(root), orientations, side, goal)
    rotations = local_rotations(skeleton, orientations)
    return Pose(skeleton, np.array(root, np.float32), rotations.astype(np.float32))


def _both(goals: LimbGoal | tuple[LimbGoal, LimbGoal]) -> list[tuple[str, LimbGoal]]:
    if isinstance(goals, tuple):
        return [("left", goals[0]), ("right", goals[1])]
    mirrored = LimbGoal(**{name: _mirror(getattr(goals, name)) for name in ("end", "pole", "direction", "normal")})
    return [("left", goals), ("right", mirrored)]


def _mirror(v: tuple[float, float, float]) -> tuple[float, float, float]:
    return (-v[0], v[1], v[2])


def _positions(skeleton: Skeleton, root: Array, orientations: Array) -> Array:
    rotations = local_rotations(skeleton, orientations)
    return np.asarray(forward_kinematics(skeleton, root, rotations).positions)


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v)


def _middle_joint(start: Array, end: Array, upper: float, lower: float, pole: Array) -> Array:
    """Knee or elbow position on the side of `pole`. Raises ValueError when the end is out of reach."""
    reach = float(np.linalg.norm(end - start))
    if reach >= upper + lower:
        raise ValueError(f"a limb of {upper + lower:.3f} m cannot reach {reach:.3f} m; move its end closer")
    axis = (end - start) / reach
    along = (upper**2 - lower**2 + reach**2) / (2 * reach)
    side = _unit(pole - axis * (pole @ axis))
    return start + along * axis + np.sqrt(upper**2 - along**2) * side


def _limb_joints(skeleton: Skeleton, bones: tuple[str, str, str]) -> tuple[int, int, int, float, float]:
    a, b, c = skeleton.indices(bones)
    offsets = skeleton.rest_offsets
    return a, b, c, float(np.linalg.norm(offsets[b])), float(np.linalg.norm(offsets[c]))


def _place_leg(skeleton: Skeleton, root: Array, orientations: Array, side: str, goal: LimbGoal) -> None:
    """Thigh and shank share the knee's hinge (local X); the foot points its own way."""
    bones = (f"{side}UpperLeg", f"{side}LowerLeg", f"{side}Foot")
    a, b, c, thigh, shank = _limb_joints(skeleton, bones)
    hip = _positions(skeleton, root, orientations)[a]
    ankle = np.array(goal.end)
    knee = _middle_joint(hip, ankle, thigh, shank, np.array(goal.pole))
    hinge = _unit(np.cross(knee - hip, ankle - knee))
    for joint, bone in ((a, knee - hip), (b, ankle - knee)):
        up = -_unit(bone)
        orientations[joint] = quat_from_axes(hinge, up, np.cross(hinge, up))
    foot = _frame(forward=np.array(goal.direction), up=np.array(goal.normal))
    orientations[c] = foot
    orientations[skeleton.index(f"{side}Toes")] = foot


def _place_arm(skeleton: Skeleton, root: Array, orientations: Array, side: str, goal: LimbGoal) -> None:
    """Upper and lower arm share the elbow's hinge (local Y); the forearm takes half of the hand's twist."""
    bones = (f"{side}UpperArm", f"{side}LowerArm", f"{side}Hand")
    a, b, c, upper, lower = _limb_joints(skeleton, bones)
    sign = SIDES[side]
    shoulder = _positions(skeleton, root, orientations)[a]
    wrist = np.array(goal.end)
    elbow = _middle_joint(shoulder, wrist, upper, lower, np.array(goal.pole))
    hinge = -sign * _unit(np.cross(elbow - shoulder, wrist - elbow))
    along = [sign * _unit(elbow - shoulder), sign * _unit(wrist - elbow), sign * _unit(np.array(goal.direction))]
    orientations[a] = quat_from_axes(along[0], hinge, np.cross(along[0], hinge))
    back = np.array(goal.normal)
    orientations[c] = _arm_frame(along[2], back)
    orientations[b] = _arm_frame(along[1], _unit(hinge) + _unit(back - along[1] * (back @ along[1])))


def _arm_frame(x: Array, up: Array) -> Array:
    y = _unit(up - x * (up @ x))
    return np.asarray(quat_from_axes(x, y, np.cross(x, y)))


def _frame(*, forward: Array, up: Array) -> Array:
    z = _unit(forward)
    x = _unit(np.cross(up, z))
    return np.asarray(quat_from_axes(x, np.cross(z, x), z))


def tilted(pose: Pose, joint: str, degrees: tuple[float, float, float]) -> Pose:
    """The pose with one joint turned further by a rotation vector [degrees] in its own frame."""
    rotations = pose.rotations.copy()
    j = pose.skeleton.index(joint)
    rotations[j] = quat_mul(rotations[j], quat_from_rotvec(np.radians(np.array(degrees, np.float32))))
    return Pose(pose.skeleton, pose.root_position, rotations)


__all__ = ["LimbGoal", "author_pose", "quat_rotate", "tilted"]
