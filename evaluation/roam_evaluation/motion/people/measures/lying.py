"""Lying down: from sitting to supine, whatever the surface; and whether getting up is the same played backwards."""

import numpy as np

from roam_evaluation.motion.people.frames import ANKLES, HANDS, HEAD, HIPS, NECK, RATE, Motion, Stretch
from roam_evaluation.motion.people.measures.posture import smooth, speed

_UPRIGHT, _FLAT = 30.0, 70.0  # [degrees] of the trunk from the vertical: reclining is between
_POINTS = 40  # of a way, resampled by the path of the hips and head
_LONGEST = 240  # frames before lying in which the way down is looked for


def tilt(motion: Motion) -> np.ndarray:
    """Angle of the trunk (mid-hip to neck) from the vertical [T] [degrees]."""
    trunk = motion.positions[:, NECK] - motion.hips
    return np.degrees(np.arccos((trunk[:, 1] / np.linalg.norm(trunk, axis=-1)).clip(-1, 1)))


def held(motion: Motion) -> list[Stretch]:
    """The stretches of lying that the labels name."""
    return [s for s in motion.stretches if s.label == "lie held"]


def reclining(motion: Motion, lie: Stretch) -> tuple[int, int] | None:
    """First and last frame of the trunk's way from 30 to 70 degrees, the last one before lying."""
    angle = smooth(tilt(motion), 5)[: lie.first + 30]
    flat = np.flatnonzero(angle < _FLAT)
    steep = np.flatnonzero(angle < _UPRIGHT)
    if not len(flat) or not len(steep) or int(flat[-1]) < int(steep[-1]):
        return None
    return int(steep[-1]), min(int(flat[-1]) + 1, len(angle) - 1)


def measure_down(motion: Motion, lie: Stretch) -> dict[str, float] | None:
    """Measures of reclining; None when it is not there."""
    span = reclining(motion, lie)
    if span is None:
        return None
    first, last = span
    part, hips = motion.positions[first : last + 1], motion.hips[first : last + 1, 1]
    around = motion.positions[max(first - 30, 0) : last + 15]
    ankles = around[:, ANKLES, 1] - around[:, HIPS, 1][:, None]
    return {
        "recline": (last - first) / RATE,
        "both_feet_over_hips": 100 * float(ankles.min(1).max()),
        "feet_apart_in_height": 100 * float(np.abs(ankles[:, 0] - ankles[:, 1]).max()),
        "lower_hand": 100 * float((part[:, HANDS, 1].min(1) - hips).min()),
        "head_speed": float(speed(motion.positions[:, HEAD])[first : last + 1].max()),
        "way_to_lying": (lie.first - _begun(motion, lie)) / RATE,
    }


def _begun(motion: Motion, lie: Stretch) -> int:
    """Last frame of standing before lying."""
    height = motion.positions[:, HIPS, 1]
    tall = np.flatnonzero(height[: lie.first] > 0.9 * np.quantile(height[: lie.first + 1], 0.95))
    return max(int(tall[-1]) if len(tall) else 0, lie.first - _LONGEST)


def reversal(motion: Motion, lie: Stretch) -> float | None:
    """Mean distance of the joints while getting up from the way down played backwards [cm], at equal shares of the
    way; None when one of the two is not there."""
    down = motion.positions[_begun(motion, lie) : lie.first + 1]
    height = motion.positions[:, HIPS, 1]
    after = np.flatnonzero(height[lie.last :] > 0.9 * np.quantile(height, 0.95))
    if not len(after) or len(down) < 10:
        return None
    up = motion.positions[lie.last : lie.last + int(after[0]) + 1]
    return 100 * float(np.linalg.norm(_even(down[::-1]) - _even(up), axis=-1).mean())


def _even(way: np.ndarray) -> np.ndarray:
    """A way [T, J, 3] at equal shares of the path that all joints travel [_POINTS, J, 3]."""
    path = np.concatenate([[0], np.linalg.norm(np.diff(way, axis=0), axis=-1).mean(1).cumsum()])
    at = np.interp(np.linspace(0, path[-1], _POINTS), path, np.arange(len(way)))
    low = np.minimum(at.astype(int), len(way) - 2)
    share = (at - low)[:, None, None]
    return np.asarray(way[low] * (1 - share) + way[low + 1] * share)
