"""Goal poses to train with: seated and lying key poses of the clips, mixed and perturbed.

Captured sits are few, and at run time goal poses come from the goal-pose service on furniture nobody sat on here. So a
training goal takes the trunk and arms of one seated pose and the legs of another, a new seat height, a new lean, new
feet on the floor (leg IK), and a few degrees of noise in every joint. Lying goals are only shifted and perturbed. Where
goal poses that the goal-pose service made are at hand, every other goal is one of them, hardly perturbed.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from roam_character.clip import Clip
from roam_character.kinematics import facing, forward_kinematics, limb, reach_with_limb
from roam_character.rotation import (
    angle_wrap,
    quat_from_rotvec,
    quat_from_yaw,
    quat_mul,
    quat_normalize,
    quat_slerp,
    yaw_direction,
)
from roam_character.skeleton import Skeleton

LEGS = ("leftLeg", "rightLeg")
_HIPS_OVER_SEAT = 0.085 + 0.06  # hip joints over the seat, hips over the hip joints [m]
_ARMS = ("leftShoulder", "leftUpperArm", "leftLowerArm", "leftHand")
_GIVEN_SHARE = 0.5  # of goals, where there are given ones
_GIVEN_NOISE = 0.25  # share of the noise that captured poses get


@dataclass(frozen=True)
class Key:
    """A pose as plain arrays: hips [3] [m], local rotations [J, 4]."""

    hips: np.ndarray
    rotations: np.ndarray


@dataclass(frozen=True)
class Bank:
    """Poses of one action to make goals of, over the origin, facing +Z."""

    captured: list[Key]  # held key poses of the clips
    given: list[Key] = field(default_factory=list)  # goal poses synthesised on furniture


def read_given(skeleton: Skeleton, folder: Path, action: str) -> list[Key]:
    """The goal poses of `folder`/*-ACTION.json (see roam_evaluation.motion.goals) and their mirror images."""
    records = [json.loads(path.read_text()) for path in sorted(folder.glob(f"*-{action}.json"))]
    if not records:
        return []
    hips = np.array([r["root_position"] for r in records], np.float32)
    hips[:, 1] -= np.array([r["floor_height"] for r in records], np.float32)
    poses = Clip(skeleton, 1.0, hips, np.array([r["rotations"] for r in records], np.float32))
    pairs = [
        pair for clip in (poses, poses.mirrored()) for pair in zip(clip.root_positions, clip.rotations, strict=True)
    ]
    return [at_origin(skeleton, Key(*pair)) for pair in pairs]


def new_goal(skeleton: Skeleton, action: str, bank: Bank, key: Key, rng: np.random.Generator) -> Key:
    """A goal over the origin for an episode whose clip holds `key`."""
    if bank.given and rng.random() < _GIVEN_SHARE:
        given = bank.given[rng.integers(len(bank.given))]
        return Key(given.hips, _noisy(skeleton, given.rotations, rng, share=_GIVEN_NOISE))
    return sitting_goal(skeleton, bank.captured, rng) if action == "sit" else lying_goal(skeleton, [key], rng)


def _scalar(value: float) -> np.ndarray:
    return np.asarray(value, np.float32)


def key_yaw(skeleton: Skeleton, key: Key) -> float:
    """The yaw that a key pose faces [rad]."""
    return float(facing(skeleton, forward_kinematics(skeleton, key.hips, key.rotations).positions))


def at_origin(skeleton: Skeleton, key: Key) -> Key:
    """The key over the origin, facing +Z."""
    turn = quat_from_yaw(_scalar(-key_yaw(skeleton, key)))
    rotations = key.rotations.copy()
    rotations[0] = quat_mul(turn, rotations[0])
    return Key(np.array([0, key.hips[1], 0], np.float32), rotations)


def placed(key: Key, yaw: float, hips: np.ndarray) -> Key:
    """An origin key turned to `yaw` with its hips over `hips` [2] (x, z)."""
    rotations = key.rotations.copy()
    rotations[0] = quat_mul(quat_from_yaw(_scalar(yaw)), rotations[0])
    return Key(np.array([hips[0], key.hips[1], hips[1]], np.float32), rotations)


def ankles(skeleton: Skeleton, key: Key) -> np.ndarray:
    """Ankle positions [2, 3], left then right."""
    positions = forward_kinematics(skeleton, key.hips, key.rotations).positions
    return np.asarray(positions[skeleton.indices(["leftFoot", "rightFoot"])])


def with_feet(skeleton: Skeleton, key: Key, targets: np.ndarray, foot_yaws: np.ndarray | None = None) -> Key:
    """The key with its ankles brought to `targets` [2, 3] by leg IK; `foot_yaws` [2] lays the feet flat."""
    rotations = key.rotations.copy()
    for side, name in enumerate(LEGS):
        which = limb(skeleton, name)
        posture = forward_kinematics(skeleton, key.hips, rotations)
        # Knees of a sitter point forward and up.
        ahead = yaw_direction(_scalar(key_yaw(skeleton, key))) + np.array([0, 0.7, 0], np.float32)
        rotations[list(which)] = reach_with_limb(skeleton, which, posture, targets[side], bend=ahead)
        if foot_yaws is not None:
            parent = forward_kinematics(skeleton, key.hips, rotations).orientations[which.lower]
            inverse = parent * np.array([-1, -1, -1, 1], np.float32)
            rotations[which.end] = quat_mul(inverse, quat_from_yaw(_scalar(foot_yaws[side])))
            rotations[which.end + 1] = np.array([0, 0, 0, 1], np.float32)
    return Key(key.hips, quat_normalize(rotations))


def sitting_goal(skeleton: Skeleton, bank: list[Key], rng: np.random.Generator) -> Key:
    """A new seated pose over the origin, facing +Z."""
    upper, lower, other = (bank[i] for i in rng.integers(len(bank), size=3))
    rotations = upper.rotations.copy()
    legs = skeleton.indices(["leftUpperLeg", "leftLowerLeg", "leftFoot", "rightUpperLeg", "rightLowerLeg", "rightFoot"])
    rotations[legs] = lower.rotations[legs]
    for side in ("left", "right"):
        arm = skeleton.indices([name.replace("left", side) for name in _ARMS])
        rotations[arm] = quat_slerp(rotations[arm], other.rotations[arm], np.float32(rng.uniform(0, 1)))
    # Lean about the hips: backwards into a back rest, or a little forward.
    lean = np.float32(np.deg2rad(rng.uniform(-28, 12)))
    rotations[0] = quat_mul(quat_from_rotvec(np.array([lean, 0, 0], np.float32)), _half_upright(rotations[0]))
    rotations = _noisy(skeleton, rotations, rng)
    height = rng.uniform(0.34, 0.60) + _HIPS_OVER_SEAT
    key = at_origin(skeleton, Key(np.array([0, height, 0], np.float32), rotations))
    return with_feet(skeleton, key, *_feet(skeleton, height, rng))


def _half_upright(root: np.ndarray) -> np.ndarray:
    """Brings a root orientation halfway to upright, so that leans do not add up to a fall."""
    upright = np.array([0, 0, 0, 1], np.float32)
    return np.asarray(quat_slerp(root, upright, np.float32(0.5)))


def _noisy(skeleton: Skeleton, rotations: np.ndarray, rng: np.random.Generator, share: float = 1.0) -> np.ndarray:
    degrees = np.full(skeleton.joint_count, 3.0)
    degrees[skeleton.indices([n.replace("left", s) for n in _ARMS for s in ("left", "right")])] = 9.0
    noise = rng.normal(size=(skeleton.joint_count, 3)) * np.deg2rad(share * degrees)[:, None]
    return np.asarray(quat_mul(rotations, quat_from_rotvec(noise.astype(np.float32))))


def _feet(skeleton: Skeleton, height: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Ankle targets [2, 3] and foot yaws [2] for hips at a height, within reach of the legs."""
    farthest = np.sqrt(max(0.80**2 - (height - 0.14) ** 2, 0.05))
    ahead = rng.uniform(0.28, min(0.62, farthest))
    out = np.zeros((2, 3), np.float32)
    for side, sign in enumerate((1.0, -1.0)):
        forward = np.clip(ahead + rng.normal() * 0.05, 0.2, farthest)
        out[side] = (sign * np.clip(rng.normal(0.12, 0.04), 0.06, 0.24), 0.0805, forward)
    yaws = np.deg2rad(np.array([rng.normal(8, 8), rng.normal(-8, 8)]))
    return out, yaws


def lying_goal(skeleton: Skeleton, bank: list[Key], rng: np.random.Generator) -> Key:
    """A lying key pose, its joints perturbed; over the origin, facing +Z."""
    key = bank[rng.integers(len(bank))]
    return at_origin(skeleton, Key(key.hips, _noisy(skeleton, key.rotations, rng)))


def aligned(skeleton: Skeleton, goal: Key, key: Key, rng: np.random.Generator, *, by_feet: bool) -> Key:
    """The goal where the clip's key pose is: same facing, ankles (or hips) in the same place, with some error.

    The error stands for how a character arrives: mostly a few centimetres and degrees, sometimes much more.
    """
    far = rng.random() < 0.35
    yaw = key_yaw(skeleton, key) + np.deg2rad(rng.normal() * (20 if far else 7))
    shift = rng.normal(size=2) * (0.10 if far else 0.03)
    anchor = ankles(skeleton, key).mean(0)[[0, 2]] if by_feet else key.hips[[0, 2]]
    turned = placed(goal, float(angle_wrap(_scalar(yaw))), np.zeros(2))
    own = ankles(skeleton, turned).mean(0)[[0, 2]] if by_feet else np.zeros(2)
    return placed(goal, float(yaw), anchor - own + shift)
