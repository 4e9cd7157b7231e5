"""Turning on the spot: how far the legs twist, and the steps that are taken."""

from dataclasses import dataclass

import numpy as np

from roam_evaluation.motion.people.frames import ANKLES, RATE, Motion
from roam_evaluation.motion.people.measures.posture import centre_of_mass, contacts, runs, smooth, speed, twist

_TURNING = np.radians(15)  # [rad/s] of the pelvis, over half a second
_LEAST = np.radians(60)  # a turn is at least so far
_PLACE = 0.35  # [m] the hips stay within such a distance of where the turn begins …
_SLOWEST = 0.30  # [m/s] … and their mean speed along the floor is less
_UPRIGHT = 0.80  # [m] hips
_AFTER = 20  # frames after a turn that belong to it: the last foot follows
_SWING = 0.25  # [m/s] an ankle that is carried to its next place
_STEP = 0.05  # [m] a step moves the ankle, or turns the foot, at least so far
_FOOT = np.radians(12)


@dataclass(frozen=True, eq=False)
class Turn:
    """One turn on the spot: the frames, and how far the pelvis goes [rad]."""

    motion: Motion
    angle: float


def turns(motion: Motion) -> list[Turn]:
    """Turns on the spot, each with the two thirds of a second after it."""
    rate = smooth(np.gradient(motion.pelvis) * RATE, 15)
    found = []
    for sign in (1, -1):
        for first, last in runs(rate * sign > _TURNING, 8):
            hips = motion.hips[first : last + 1]
            angle = float(motion.pelvis[last] - motion.pelvis[first])
            way = np.linalg.norm((hips - hips[0])[:, [0, 2]], axis=-1)
            pace = float(np.linalg.norm(np.diff(hips[:, [0, 2]], axis=0), axis=-1).sum()) * RATE / (last - first)
            if abs(angle) < _LEAST or way.max() > _PLACE or pace > _SLOWEST or hips[:, 1].min() < _UPRIGHT:
                continue
            found.append(Turn(motion.cut(max(first - 3, 0), min(last + _AFTER, len(motion) - 1)), angle))
    return found


def measure(turn: Turn) -> dict[str, float]:
    """All measures of one turn."""
    motion, angle = turn.motion, abs(np.degrees(turn.angle))
    twisted = twist(motion)
    count = sum(len(found) for found in steps(motion))
    rate = np.abs(smooth(np.gradient(motion.pelvis) * RATE, 9))
    balance = motion.ahead(np.stack([centre_of_mass(motion.positions), motion.positions[:, ANKLES].mean(1)], 1))
    return {
        "twist_median": float(np.nanmedian(twisted)),
        "twist_p99": float(np.nanquantile(twisted, 0.99)),
        "twist_most": float(np.nanmax(twisted)),
        "twist_at_end": float(np.nanmax(twisted[-3:])),
        "steps_per_quarter": 90 * count / angle,
        "turn_rate": float(np.degrees(rate.mean())),
        "turn_rate_peak": float(np.degrees(rate.max())),
        "both_feet_down": 100 * float(contacts(motion.positions).all(1).mean()),
        "balance": 100 * float(np.abs(balance[:, 0] - balance[:, 1]).max()),
    }


def steps(motion: Motion) -> list[list[tuple[int, int]]]:
    """For each foot the first and last frames of its steps: stretches in which the ankle is carried or the foot swung
    round, at least 5 cm or 12 degrees in all."""
    out = []
    for side, joint in enumerate(ANKLES):
        ankle = motion.positions[:, joint]
        turning = np.abs(np.gradient(motion.feet[:, side])) * RATE
        moves = (speed(ankle) > _SWING) | (turning > np.radians(60))
        found = []
        for first, last in runs(_closed(moves), 3):
            way = float(np.linalg.norm((ankle[last] - ankle[first])[[0, 2]]))
            turned = abs(float(motion.feet[last, side] - motion.feet[first, side]))
            if way > _STEP or turned > _FOOT:
                found.append((first, last))
        out.append(found)
    return out


def _closed(mask: np.ndarray) -> np.ndarray:
    """With gaps of up to two frames filled."""
    out = mask.copy()
    for first, last in runs(~mask):
        if last - first < 2 and first > 0 and last < len(mask) - 1:
            out[first : last + 1] = True
    return out
