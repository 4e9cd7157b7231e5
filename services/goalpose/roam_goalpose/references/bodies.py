"""A reference pair for a body of other proportions: the same pose, on the same furniture, of somebody else."""

from dataclasses import replace

import numpy as np
import torch
from roam_character.body import body_capsules
from roam_character.clip import Clip
from roam_character.kinematics import limb
from roam_character.pose import Pose, rest_pose
from roam_character.retarget import retarget
from roam_character.rotation import quat_rotate
from roam_character.skeleton import Skeleton, humanoid_skeleton

from roam_goalpose.energy.figure import Figure
from roam_goalpose.references.legs import settle_legs
from roam_goalpose.references.model import figure_of, height_above_surface
from roam_goalpose.references.pairs import ReferencePair

NEEDED = tuple(humanoid_skeleton().humanoid_bones)
_LEGS = 0.1, 3.0  # [m] thigh and shin together: toys and giants; people have 0.4 (a child of 1 m) to 1.1
_SHORTEST = 0.05  # of the legs, of an upper or lower arm or leg
_SIDES = ("left", "right")
GROUNDED = 0.12  # [m] an ankle lower than this above the floor stands on it


def fitted(pair: ReferencePair, skeleton: Skeleton) -> ReferencePair:
    """`pair` with its pose carried over to `skeleton`: joint angles kept, hips as high over the seat as the body is
    large, as far back as its thickness allows, feet on the floor where they were on it.

    Raises RetargetError when the skeleton lacks bones.
    """
    if pair.pose.skeleton == skeleton:
        return pair
    source = pair.pose
    clip = Clip(source.skeleton, 30.0, source.root_position[None], source.rotations[None])
    turned = retarget(clip, skeleton).pose(0)
    pose = replace(turned, root_position=_hips(pair, skeleton).astype(np.float32))
    figure = figure_of(replace(pair, pose=pose))
    if _stands(figure_of(pair), pair.shape.floor_height):
        figure = settle_legs(figure, pair.shape.floor_height, ankle_height=_ankle_height(skeleton))
    return replace(pair, pose=Pose(skeleton, pose.root_position, figure.rotations[0].numpy()))


def check_bones(skeleton: Skeleton) -> None:
    """Raises ValueError, naming them, when a skeleton lacks bones that poses are made of, or nobody has such bones."""
    missing = [bone for bone in NEEDED if bone not in skeleton.humanoid_bones]
    if missing:
        raise ValueError(f"humanoid_bones lacks {', '.join(missing)}")
    if skeleton.humanoid_bones[0] != "hips":
        raise ValueError("joint 0 must be the hips")
    legs = [_length(skeleton, f"{side}{bone}") for side in _SIDES for bone in ("LowerLeg", "Foot")]
    leg = sum(legs) / 2
    if not _LEGS[0] <= leg <= _LEGS[1]:
        advice = "divide them by 100 if they are centimetres, by 1000 if they are millimetres"
        raise ValueError(f"its legs are {leg:g} m long; rest_offsets are in metres: {advice}")
    limbs = [*legs, *(_length(skeleton, f"{side}{bone}") for side in _SIDES for bone in ("LowerArm", "Hand"))]
    if min(limbs) < _SHORTEST * leg:
        raise ValueError("an upper or lower arm or leg has no length: its joint lies on its parent")
    farthest = max(np.linalg.norm([*skeleton.rest_offsets[1:], *(tip.offset for tip in skeleton.tips)], axis=-1))
    if farthest > _LEGS[1]:
        raise ValueError(f"a bone or tip is {farthest:g} m long; rest_offsets and tips are in metres")


def _length(skeleton: Skeleton, bone: str) -> float:
    """Of the way from a bone's parent joint to its own [m]."""
    return float(np.linalg.norm(skeleton.rest_offsets[skeleton.humanoid_bones.index(bone)]))


def _hips(pair: ReferencePair, skeleton: Skeleton) -> np.ndarray:
    """Where the hips joint goes [3] [m]: bodies of other sizes have other radii about the same surface."""
    height = height_above_surface(pair.shape.distance, torch.as_tensor(pair.pose.root_position))
    before, after = _hip_radius(pair.pose.skeleton), _hip_radius(skeleton)
    smaller = before - after
    # The backrest is behind a sitter, where the pelvis turns its back to.
    behind = quat_rotate(pair.pose.rotations[0], np.array([0.0, 0.0, -1.0], np.float32)) * np.array([1.0, 0.0, 1.0])
    return pair.pose.root_position + smaller * behind + np.array([0.0, height * (after / before - 1.0), 0.0])


def _hip_radius(skeleton: Skeleton) -> float:
    capsules = body_capsules(skeleton)
    return float(capsules.radii[capsules.names.index("hips")])


def _stands(figure: Figure, floor_height: float) -> bool:
    feet = [limb(figure.skeleton, f"{side}Leg").end for side in ("left", "right")]
    return bool((figure.positions[0, feet, 1] - floor_height < GROUNDED).all())


def _ankle_height(skeleton: Skeleton) -> float:
    """Of the ankle over the sole when standing [m]: the rest pose's."""
    return float(rest_pose(skeleton).positions()[skeleton.index("leftFoot"), 1])
