"""Straight walking: windows of 2.4 s found by what the body does, and what is measured of each."""

import numpy as np
from scipy.signal import find_peaks

from roam_evaluation.motion.people.frames import ANKLES, ELBOWS, HANDS, RATE, SHOULDERS, TOES, Motion
from roam_evaluation.motion.people.measures.posture import (
    bends,
    contacts,
    foot_pitch,
    head_pitch,
    jerk,
    joint_contacts,
    lean,
    smooth,
    speed,
)

WINDOW = 72  # frames: 2.4 s, two strides of a stroll
_STRAIGHT = np.radians(20)  # the facing turns less within a window
_FORWARD = np.radians(25)  # between way and facing
_UPRIGHT = 0.80  # [m] hips
_STEADY = 0.25  # largest share by which the speed of the two halves differ
_STEPS = 4  # a window of walking holds at least so many strikes
_NEAREST = 8  # frames between two strikes of one foot: runners take 20
_STRIDE = (18, 52)  # frames a stride can take, from running to strolling
_REACH = 0.08  # [m] prominence of a strike in the ankle's way


def windows(motion: Motion, speeds: tuple[float, float]) -> list[Motion]:
    """Windows in which somebody walks straight on at a speed within `speeds` [m/s]; none overlaps another."""
    found, begin = [], 0
    while begin + WINDOW < len(motion):
        part = motion.cut(begin, begin + WINDOW)
        if _walks(part, speeds):
            found.append(part)
            begin += WINDOW
        else:
            begin += 6
    return found


def _walks(part: Motion, speeds: tuple[float, float]) -> bool:
    hips = part.hips
    way, half = (hips[-1] - hips[0])[[0, 2]], len(hips) // 2
    pace = float(np.linalg.norm(way)) * RATE / (len(hips) - 1)
    if not speeds[0] <= pace < speeds[1] or hips[:, 1].min() < _UPRIGHT - 0.06:
        return False
    aside = np.arctan2(way[0], way[1]) - part.facing.mean()
    aside = abs((aside + np.pi) % (2 * np.pi) - np.pi)
    turned = float(np.ptp(smooth(part.facing, 31)))
    halves = [np.linalg.norm((hips[b] - hips[a])[[0, 2]]) for a, b in ((0, half), (half, len(hips) - 1))]
    steady = abs(halves[0] - halves[1]) < _STEADY * max(sum(halves) / 2, 1e-6)
    return bool(turned < _STRAIGHT and aside < _FORWARD and steady and len(np.concatenate(strikes(part))) >= _STEPS)


def course(motion: Motion) -> np.ndarray:
    """The way's heading as a constant yaw [T] [rad]."""
    way = (motion.hips[-1] - motion.hips[0])[[0, 2]]
    return np.full(len(motion), np.arctan2(way[0], way[1]))


def strikes(motion: Motion) -> list[np.ndarray]:
    """Frames at which each foot strikes: its ankle is farthest in front of the hips."""
    ahead = smooth(motion.ahead(motion.positions[:, ANKLES], course(motion)), 3)
    return [find_peaks(ahead[:, side], distance=_NEAREST, prominence=_REACH)[0] for side in (0, 1)]


def measure(motion: Motion) -> dict[str, float]:
    """All measures of one window of straight walking; NaN where it holds too few steps for one."""
    struck = strikes(motion)
    out = {**_legs(motion, struck), **_trunk(motion), **_steps(motion, struck), **_arms(motion)}
    out["change_between_strides"] = _change(motion.local)
    out["jerk"] = jerk(motion.positions)
    out["speed"] = float(np.linalg.norm((motion.hips[-1] - motion.hips[0])[[0, 2]])) * RATE / (len(motion) - 1)
    return out


def _legs(motion: Motion, struck: list[np.ndarray]) -> dict[str, float]:
    positions = motion.positions
    knee, stands, pitch = bends(positions), contacts(positions), foot_pitch(positions)
    touching = joint_contacts(positions)
    flat = [_median(pitch[touching[:, side].all(-1), side]) for side in (0, 1)]
    at = [(t, side) for side in (0, 1) for t in struck[side]]
    own = [np.mean([knee[t, side] for t in struck[side]]) if len(struck[side]) else np.nan for side in (0, 1)]
    return {
        "knee_at_strike": float(np.mean([knee[t, side] for t, side in at])),
        "knee_at_strike_difference": float(abs(own[0] - own[1])),
        "knee_in_stance": _most(knee, stands),
        "foot_pitch_at_strike": float(np.mean([pitch[t, side] - flat[side] for t, side in at])),
        "toe_clearance": 100 * _clearance(motion),
        "double_support": 100 * float(stands.all(1).mean()),
        "foot_skate": 100 * _skate(positions, touching),
    }


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def _most(knee: np.ndarray, stands: np.ndarray) -> float:
    """Mean over both legs of the largest bend while the foot stands [degrees]."""
    return float(np.mean([knee[stands[:, side], side].max() if stands[:, side].any() else np.nan for side in (0, 1)]))


def _clearance(motion: Motion) -> float:
    """Height of the toe joint over its own lowest twentieth when the swinging ankle passes the other [m]."""
    ahead = motion.ahead(motion.positions[:, ANKLES], course(motion))
    apart, toes = ahead[:, 0] - ahead[:, 1], motion.positions[:, TOES, 1]
    ground = np.quantile(toes, 0.05, axis=0)
    passing = np.flatnonzero(np.diff(np.sign(apart)) != 0)
    swinging = [0 if apart[t + 1] > apart[t] else 1 for t in passing]
    heights = [toes[t, side] - ground[side] for t, side in zip(passing, swinging, strict=True)]
    return float(np.mean(heights)) if heights else float("nan")


def _skate(positions: np.ndarray, touching: np.ndarray) -> float:
    """Mean speed along the floor of ankles and toe joints in contact [m/s]."""
    points = np.stack([positions[:, ANKLES], positions[:, TOES]], 2)[..., [0, 2]]
    return float(speed(points)[touching].mean()) if touching.any() else float("nan")


def _trunk(motion: Motion) -> dict[str, float]:
    height = motion.positions[:, 0, 1]
    forward = (motion.hips[:, [0, 2]] * np.stack([np.sin(course(motion)), np.cos(course(motion))], 1)).sum(1)
    pace = smooth(np.gradient(forward) * RATE, 3)
    return {
        "hips_bob": 100 * _within(height - _trend(height)),
        "pelvis_turn": float(np.degrees(_within(motion.pelvis - _trend(motion.pelvis)))),
        "trunk_pitch_range": _within(lean(motion)),
        "head_pitch_range": _within(head_pitch(motion)),
        "speed_change": _within(pace),
    }


def _trend(values: np.ndarray) -> np.ndarray:
    """A straight line through values [T]."""
    t = np.arange(len(values))
    return np.asarray(np.polyval(np.polyfit(t, values, 1), t))


def _within(values: np.ndarray) -> float:
    """Range within a stride, about 36 frames: the mean of both halves of a window."""
    half = len(values) // 2
    return float(np.mean([np.ptp(values[:half]), np.ptp(values[half:])]))


def _steps(motion: Motion, struck: list[np.ndarray]) -> dict[str, float]:
    yaw = course(motion)
    ankles = motion.positions[:, ANKLES]
    ahead, aside = motion.ahead(ankles, yaw), motion.aside(ankles, yaw)
    length = [np.mean([abs(ahead[t, 0] - ahead[t, 1]) for t in struck[side]]) for side in (0, 1)]
    width = [aside[t, 0] - aside[t, 1] for side in (0, 1) for t in struck[side]]
    times = np.sort(np.concatenate(struck))
    return {
        "step_length": 100 * float(np.mean(length)),
        "step_difference": 100 * float(abs(length[0] - length[1]) / np.mean(length)),
        "step_width": 100 * float(np.mean(width)),
        "cadence": 60 * RATE * (len(times) - 1) / float(times[-1] - times[0]),
    }


def _arms(motion: Motion) -> dict[str, float]:
    ahead = motion.ahead(motion.positions[:, HANDS]) - motion.ahead(motion.positions[:, SHOULDERS])
    ankles = motion.ahead(motion.positions[:, ANKLES])
    swing = np.ptp(ahead, axis=0)
    upper = motion.ahead(motion.positions[:, ELBOWS]) - motion.ahead(motion.positions[:, SHOULDERS])
    hanging = motion.positions[:, SHOULDERS, 1] - motion.positions[:, ELBOWS, 1]
    elbow = bends(motion.positions, (SHOULDERS, ELBOWS, HANDS))
    with np.errstate(invalid="ignore"):
        phase = [np.corrcoef(ahead[:, side], ankles[:, 1 - side])[0, 1] for side in (0, 1)]
    return {
        "arm_swing": 100 * float(swing.mean()),
        "arm_swing_difference": 100 * float(abs(swing[0] - swing[1])),
        "arm_phase": float(np.mean(phase)),
        "upper_arm": float(np.degrees(np.arctan2(upper, hanging)).mean()),
        "elbow": float(elbow.mean()),
        "elbow_range": float(np.ptp(elbow, axis=0).mean()),
    }


def _change(local: np.ndarray) -> float:
    """Root mean square distance of joints [cm], in the hips' frame, between frames and those one stride later; the
    stride's time is the lag with the smallest."""
    apart = [
        np.sqrt(((local[lag:] - local[:-lag]) ** 2).sum(-1).mean()) for lag in range(*_STRIDE) if lag < len(local) - 15
    ]
    return 100 * float(min(apart))
