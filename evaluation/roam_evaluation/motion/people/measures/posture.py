"""Angles, balance and contacts of a body in frames [T, 22, 3]: what all activities are measured with."""

from collections.abc import Sequence

import numpy as np
from scipy.signal import butter, sosfiltfilt

from roam_evaluation.motion.people.frames import (
    ANKLES,
    HEAD,
    HIPS,
    KNEES,
    NECK,
    RATE,
    SIDES,
    SKELETON,
    THIGHS,
    TOES,
    Motion,
)

# Share of the body's mass and place of its centre between the segment's two ends, from the proximal one.
# Winter, Biomechanics and Motor Control of Human Movement, 4th ed., table 4.1; the head and neck's mass hangs half-way
# from neck to head joint and a head's radius farther.
_SEGMENTS = (
    ("UpperArm", "LowerArm", 0.028, 0.436),
    ("LowerArm", "Hand", 0.022, 0.682),  # forearm and hand
    ("UpperLeg", "LowerLeg", 0.100, 0.433),
    ("LowerLeg", "Foot", 0.0465, 0.433),
    ("Foot", "Toes", 0.0145, 0.5),
)
_TRUNK, _HEAD_AND_NECK = 0.497, 0.081
_SMOOTH = butter(4, 5.0, fs=RATE, output="sos")
_SLOW = 0.45  # [m/s] a joint of a foot in contact is slower
_LEVEL = 0.7  # a foot has a heading while this share of its length is level: pitched less than 45 degrees
_LOW = 0.05  # [m] and lower than this over the lowest twentieth of its heights


def centre_of_mass(positions: np.ndarray) -> np.ndarray:
    """Centre of mass [T, 3] [m] after Winter's segment masses. Positions [T, 22, 3]."""
    total = _TRUNK * (0.5 * positions[:, THIGHS].mean(1) + 0.5 * positions[:, NECK])
    total = total + _HEAD_AND_NECK * (positions[:, HEAD] + 0.35 * (positions[:, HEAD] - positions[:, NECK]))
    weight = _TRUNK + _HEAD_AND_NECK
    for near, far, mass, share in _SEGMENTS:
        for side in SIDES:
            a, b = SKELETON.indices([f"{side}{near}", f"{side}{far}"])
            total = total + mass * ((1 - share) * positions[:, a] + share * positions[:, b])
            weight += mass
    return np.asarray(total / weight)


def lean(motion: Motion) -> np.ndarray:
    """Forward lean of the trunk [T] [degrees]: neck minus mid-hip against the vertical, along the facing."""
    trunk = motion.positions[:, NECK] - motion.hips
    forward = trunk[:, 0] * np.sin(motion.facing) + trunk[:, 2] * np.cos(motion.facing)
    return np.degrees(np.arctan2(forward, trunk[:, 1]))


def head_pitch(motion: Motion) -> np.ndarray:
    """Pitch of neck to head [T] [degrees], along the facing, forward positive."""
    up = motion.positions[:, HEAD] - motion.positions[:, NECK]
    forward = up[:, 0] * np.sin(motion.facing) + up[:, 2] * np.cos(motion.facing)
    return np.degrees(np.arctan2(forward, up[:, 1]))


def bends(positions: np.ndarray, chain: Sequence[Sequence[int]] = (THIGHS, KNEES, ANKLES)) -> np.ndarray:
    """How far a joint is bent, left and right [T, 2] [degrees]: 0 for a straight limb. Knees by default."""
    root, middle, end = (positions[:, list(pair)] for pair in chain)
    upper, lower = middle - root, end - middle
    cosine = (upper * lower).sum(-1) / (np.linalg.norm(upper, axis=-1) * np.linalg.norm(lower, axis=-1))
    return np.degrees(np.arccos(cosine.clip(-1, 1)))


def foot_pitch(positions: np.ndarray) -> np.ndarray:
    """How far the toe joints are raised over the ankles, left and right [T, 2] [degrees]."""
    foot = positions[:, TOES] - positions[:, ANKLES]
    return np.degrees(np.arctan2(foot[..., 1], np.linalg.norm(foot[..., [0, 2]], axis=-1)))


def speed(points: np.ndarray) -> np.ndarray:
    """Speed [T, …] [m/s] of points [T, …, 3] (or 2), central differences."""
    return np.linalg.norm(np.gradient(points, axis=0), axis=-1) * RATE


def joint_contacts(positions: np.ndarray, *, slower: float = _SLOW) -> np.ndarray:
    """Contacts [T, 2, 2] bool of (left, right) x (ankle, toe joint): slower than 0.45 m/s and within 5 cm of the
    lowest twentieth of the joint's own heights. Runners' feet need a faster limit."""
    points = np.stack([positions[:, ANKLES], positions[:, TOES]], 2)  # [T, side, ankle or toes, 3]
    height = points[..., 1]
    return np.asarray((speed(points) < slower) & (height < np.quantile(height, 0.05, axis=0) + _LOW))


def contacts(positions: np.ndarray) -> np.ndarray:
    """Whether each foot stands [T, 2]: its ankle or its toe joint is in contact."""
    return np.asarray(joint_contacts(positions).any(-1))


def twist(motion: Motion) -> np.ndarray:
    """Angle between each foot and the pelvis [T, 2] [degrees], not negative.

    NaN where a foot points so steeply down or up, as at toe-off, that it has no heading.
    """
    apart = motion.feet - motion.pelvis[:, None]
    angle = np.abs(np.degrees((apart + np.pi) % (2 * np.pi) - np.pi))
    foot = motion.positions[:, TOES] - motion.positions[:, ANKLES]
    level = np.linalg.norm(foot[..., [0, 2]], axis=-1) / np.linalg.norm(foot, axis=-1)
    return np.where(level > _LEVEL, angle, np.nan)


def jerk(positions: np.ndarray) -> float:
    """Mean jerk of all joints [m/s^3], of what is slower than 5 Hz: above that, captured clips show their noise and the
    corners of their 24 Hz."""
    smooth = sosfiltfilt(_SMOOTH, positions, axis=0, padlen=min(20, len(positions) - 2))
    return float(np.linalg.norm(np.diff(smooth, n=3, axis=0), axis=-1).mean() * RATE**3)


def runs(mask: np.ndarray, shortest: int = 1) -> list[tuple[int, int]]:
    """First and last index of every run of True in `mask` [T] at least `shortest` long."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= shortest]


def smooth(values: np.ndarray, frames: int) -> np.ndarray:
    """Moving average over an odd number of frames along the first axis; the ends are held."""
    half = frames // 2
    padded = np.concatenate([np.repeat(values[:1], half, 0), values, np.repeat(values[-1:], half, 0)])
    sums = np.cumsum(np.concatenate([np.zeros_like(padded[:1]), padded]), axis=0)
    return np.asarray((sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1))


def hips_height(positions: np.ndarray) -> np.ndarray:
    """Height of the hips joint [T] [m]."""
    return positions[:, HIPS, 1]
