"""Motion of one humanoid on another: orientations by rest-pose alignment, feet by leg IK.

Every target bone takes the world turn of its source bone, corrected by the smallest rotation between the two rest
directions; bones that the source lacks lie halfway between their neighbours. The hips are placed so that both figures
share the middle of the hip joints (scaled by leg length), then the legs bend so that the ankles are where the source's
are: planted feet stay planted. Toes bend rather than sink into the floor.
"""

import numpy as np

from roam_character.clip import Clip
from roam_character.humanoid import humanoid_bones_of
from roam_character.kinematics import Posture, forward_kinematics, limb, local_rotations, reach_with_limb
from roam_character.rotation import (
    quat_between,
    quat_from_rotvec,
    quat_mul,
    quat_rotate,
    quat_slerp,
    vec_cross,
    vec_normalize,
)
from roam_character.skeleton import Skeleton

# Where each bone points: the bone whose joint marks its far end.
_AHEAD = {
    "Shoulder": "UpperArm",
    "UpperArm": "LowerArm",
    "LowerArm": "Hand",
    "UpperLeg": "LowerLeg",
    "LowerLeg": "Foot",
}
_NEEDED = (
    "hips",
    "head",
    *(s + b for s in ("left", "right") for b in _AHEAD if b != "Shoulder"),
    "leftFoot",
    "rightFoot",
)


class RetargetError(ValueError):
    """The source skeleton lacks bones; the message names them and the joint names it has."""


def retarget(clip: Clip, skeleton: Skeleton, *, floor: float = 0.0) -> Clip:
    """The motion of `clip` on `skeleton`, same frames.

    `floor` is the floor's height in the clip [m]. Raises RetargetError when a needed humanoid bone cannot be found.
    """
    if clip.skeleton == skeleton:
        return clip
    source = humanoid_bones_of(clip.skeleton)
    missing = [bone for bone in _NEEDED if bone not in source]
    if missing:
        raise RetargetError(
            f"cannot find the bones {', '.join(missing)} among the joints {', '.join(clip.skeleton.joint_names)}; "
            "rename them to VRM, Mixamo, CMU or SMPL names, or state humanoid_bones in the skeleton"
        )
    posture = clip.posture()
    scale = _leg_length(skeleton, humanoid_bones_of(skeleton)) / _leg_length(clip.skeleton, source)
    orientations = _orientations(clip.skeleton, source, posture.orientations, skeleton)
    roots = _roots(posture.positions, source, skeleton, orientations, scale, floor)
    rotations = local_rotations(skeleton, orientations)
    rotations = _plant_feet(skeleton, roots, rotations, posture.positions, source, scale, floor)
    rotations = _toes_above(skeleton, roots, rotations, floor)
    return Clip(skeleton, clip.frame_rate, roots.astype(np.float32), rotations.astype(np.float32))


def _leg_length(skeleton: Skeleton, bones: dict[str, int]) -> float:
    return sum(float(np.linalg.norm(skeleton.rest_offsets[bones[b]])) for b in ("leftLowerLeg", "leftFoot"))


def _rest_direction(skeleton: Skeleton, bones: dict[str, int], bone: str) -> np.ndarray | None:
    """Unit rest direction of a limb bone in the world, or None where no alignment is wanted (trunk, hands, feet)."""
    side = "left" if bone.startswith("left") else "right" if bone.startswith("right") else ""
    ahead = _AHEAD.get(bone.removeprefix(side)) if side else None
    if ahead is None or side + ahead not in bones:
        return None
    rest = forward_kinematics(skeleton, skeleton.rest_offsets[0], skeleton.rest_rotations).positions
    return np.asarray(vec_normalize(rest[bones[side + ahead]] - rest[bones[bone]]))


def _orientations(source: Skeleton, found: dict[str, int], turns: np.ndarray, target: Skeleton) -> np.ndarray:
    """World orientations [T, J, 4] of the target's joints."""
    rest = forward_kinematics(source, source.rest_offsets[0], source.rest_rotations).orientations
    own = humanoid_bones_of(target)
    known: dict[int, np.ndarray] = {}
    for bone, joint in own.items():
        if bone not in found:
            continue
        turn = quat_mul(turns[:, found[bone]], np.broadcast_to(_inverse(rest[found[bone]]), (len(turns), 4)))
        there, here = _rest_direction(source, found, bone), _rest_direction(target, own, bone)
        if there is not None and here is not None:
            turn = quat_mul(turn, np.broadcast_to(quat_between(here, there), turn.shape))
        known[joint] = turn
    return np.stack([_known_or_between(target, known, j) for j in range(target.joint_count)], axis=1)


def _inverse(q: np.ndarray) -> np.ndarray:
    return q * np.array([-1, -1, -1, 1], q.dtype)


def _known_or_between(skeleton: Skeleton, known: dict[int, np.ndarray], joint: int) -> np.ndarray:
    if joint in known:
        return known[joint]
    above = skeleton.parents[joint]
    while above not in known:
        above = skeleton.parents[above]
    below = next((j for j in sorted(known) if _descends(skeleton, j, joint)), None)
    return known[above] if below is None else quat_slerp(known[above], known[below], 0.5)


def _descends(skeleton: Skeleton, joint: int, ancestor: int) -> bool:
    while joint > ancestor:
        joint = skeleton.parents[joint]
    return joint == ancestor


def _roots(
    positions: np.ndarray,
    source: dict[str, int],
    skeleton: Skeleton,
    orientations: np.ndarray,
    scale: float,
    floor: float,
) -> np.ndarray:
    """Root positions [T, 3]: the middle of the hip joints coincides, heights measured from the floor."""
    middle = (positions[:, source["leftUpperLeg"]] + positions[:, source["rightUpperLeg"]]) / 2
    middle = middle * scale + np.array([0, floor * (1 - scale), 0])
    legs = skeleton.rest_offsets[skeleton.indices(["leftUpperLeg", "rightUpperLeg"])].mean(axis=0)
    return middle - quat_rotate(orientations[:, 0], np.broadcast_to(legs, middle.shape))


def _plant_feet(
    skeleton: Skeleton,
    roots: np.ndarray,
    rotations: np.ndarray,
    positions: np.ndarray,
    source: dict[str, int],
    scale: float,
    floor: float,
) -> np.ndarray:
    rotations = rotations.copy()
    lift = _ankle_height(skeleton)
    for side in ("left", "right"):
        ankle = positions[:, source[side + "Foot"]] * scale + np.array([0, floor * (1 - scale), 0])
        ankle[:, 1] = np.maximum(ankle[:, 1], floor + lift * 0.9)
        which = limb(skeleton, side + "Leg")
        posture = forward_kinematics(skeleton, roots, rotations)
        ahead = quat_rotate(posture.orientations[:, which.lower], np.broadcast_to([0.0, 0.0, 1.0], ankle.shape))
        rotations[:, list(which)] = reach_with_limb(skeleton, which, posture, ankle, bend=ahead)
    return rotations


def _ankle_height(skeleton: Skeleton) -> float:
    """Ankle height above the sole in the rest pose [m]."""
    toes = humanoid_bones_of(skeleton)
    rest = forward_kinematics(skeleton, skeleton.rest_offsets[0], skeleton.rest_rotations).positions
    return float(rest[toes["leftFoot"], 1])


def _toes_above(skeleton: Skeleton, roots: np.ndarray, rotations: np.ndarray, floor: float) -> np.ndarray:
    """Turns feet up until the ball is above the floor, and lays toes flat that would reach into it."""
    bones = humanoid_bones_of(skeleton)
    rotations = rotations.copy()
    tips = {tip.parent: np.array(tip.offset, np.float32) for tip in skeleton.tips}
    for side in ("left", "right"):
        foot, toes = bones.get(side + "Foot"), bones.get(side + "Toes")
        if foot is None or toes is None:
            continue
        ball = float(forward_kinematics(skeleton, skeleton.rest_offsets[0], skeleton.rest_rotations).positions[toes, 1])
        for joint, offset, least in ((foot, skeleton.rest_offsets[toes], ball), (toes, tips.get(toes), ball * 0.5)):
            if offset is None:
                continue
            posture = forward_kinematics(skeleton, roots, rotations)
            rotations[:, joint] = _raised(skeleton, posture, rotations, joint, offset, floor + least)
    return rotations


def _raised(
    skeleton: Skeleton, posture: Posture, rotations: np.ndarray, joint: int, offset: np.ndarray, least: float
) -> np.ndarray:
    """Local rotations [T, 4] of a joint whose bone's end shall not lie below the height `least` [m]."""
    arm = quat_rotate(posture.orientations[:, joint], np.broadcast_to(offset, (len(rotations), 3)))
    length = np.linalg.norm(arm, axis=-1)
    pitch = np.arcsin(np.clip(arm[:, 1] / length, -1, 1))
    wanted = np.arcsin(np.clip((least - posture.positions[:, joint, 1]) / length, -1, 1))
    rise = np.maximum(wanted - pitch, 0.0)
    flat = arm * np.array([1, 0, 1])
    axis = vec_normalize(vec_cross(flat, np.broadcast_to([0.0, 1.0, 0.0], flat.shape)))
    turned = quat_mul(quat_from_rotvec(axis * rise[:, None]), posture.orientations[:, joint])
    parent = posture.orientations[:, skeleton.parents[joint]]
    return quat_mul(_inverse(parent), turned)
