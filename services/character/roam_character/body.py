"""The stand-in body: capsules on the bones, for showing a person and for measuring penetration.

Radii are those of a slim adult of 1.69 m, by VRM humanoid bone, so that any humanoid skeleton gets a body.
"""

from dataclasses import dataclass

import numpy as np

from roam_character.arrays import Array, like
from roam_character.rotation import quat_rotate
from roam_character.skeleton import Skeleton

# Radius [m] of the capsule on each humanoid bone, from the bone's joint to its child's.
_RADII = {
    "hips": 0.105,
    "spine": 0.105,
    "chest": 0.11,
    "upperChest": 0.11,
    "neck": 0.05,
    "head": 0.085,
    "Shoulder": 0.05,
    "UpperArm": 0.045,
    "LowerArm": 0.037,
    "Hand": 0.03,
    "UpperLeg": 0.07,
    "LowerLeg": 0.05,
    "Foot": 0.04,
    "Toes": 0.025,
}


@dataclass(frozen=True, eq=False)
class Capsules:
    """C capsules, each in the frame of the joint that carries it."""

    joints: np.ndarray  # [C] joint index
    starts: np.ndarray  # [C, 3] [m]
    ends: np.ndarray  # [C, 3] [m]
    radii: np.ndarray  # [C] [m]
    names: tuple[str, ...]  # bone names

    def segments(self, positions: Array, orientations: Array) -> tuple[Array, Array]:
        """World end points of the axes: two [..., C, 3] from joint placements [..., J, 3], [..., J, 4]."""
        joints = [int(j) for j in self.joints]
        origin, turn = positions[..., joints, :], orientations[..., joints, :]
        starts = origin + quat_rotate(turn, like(self.starts, positions))
        ends = origin + quat_rotate(turn, like(self.ends, positions))
        return starts, ends


def _radius(bone: str) -> float | None:
    plain = bone.removeprefix("left").removeprefix("right")
    return _RADII.get(plain)


def body_capsules(skeleton: Skeleton) -> Capsules:
    """Capsules of every humanoid bone with a radius; hands, head and toes end at the skeleton's tips.

    The hips' capsule lies across the hip joints; radii scale with the skeleton's height.
    """
    scale = _height(skeleton) / 1.69
    rows: list[tuple[int, np.ndarray, np.ndarray, float, str]] = []
    zero = np.zeros(3, np.float32)
    for joint, bone in enumerate(skeleton.humanoid_bones):
        radius = _radius(bone)
        if radius is None:
            continue
        start = zero
        if bone == "hips":
            legs = skeleton.indices(["leftUpperLeg", "rightUpperLeg"])
            start, end = (skeleton.rest_offsets[leg] * np.array([0.75, 1, 1], np.float32) for leg in legs)
        else:
            end = _bone_end(skeleton, joint)
        rows.append((joint, start, end, radius * scale, bone))
    joints, starts, ends, radii, names = zip(*rows, strict=True)
    return Capsules(np.array(joints), np.stack(starts), np.stack(ends), np.array(radii, np.float32), names)


def _height(skeleton: Skeleton) -> float:
    """Sum of leg and trunk bone lengths in the rest pose: the standing height but for the ankle [m]."""
    chain = [skeleton.index("head")]
    while skeleton.parents[chain[-1]] > 0:
        chain.append(skeleton.parents[chain[-1]])
    trunk = sum(float(np.linalg.norm(skeleton.rest_offsets[j])) for j in chain)
    legs = skeleton.indices(["leftLowerLeg", "leftFoot"])
    return trunk + sum(float(np.linalg.norm(skeleton.rest_offsets[j])) for j in legs) + 0.39


def _bone_end(skeleton: Skeleton, joint: int) -> np.ndarray:
    """Where the bone of a joint ends, in the joint's frame: its tip, else its middle child, else a short stub [m]."""
    for tip in skeleton.tips:
        if tip.parent == joint:
            offset = np.array(tip.offset, np.float32)
            return offset * (0.55 if skeleton.humanoid_bones[joint] == "head" else 1.0)
    children = [c for c, p in enumerate(skeleton.parents) if p == joint]
    if not children:
        return skeleton.rest_offsets[joint] * np.float32(0.5)
    middle = min(children, key=lambda c: abs(float(skeleton.rest_offsets[c][0])))
    return skeleton.rest_offsets[middle]
