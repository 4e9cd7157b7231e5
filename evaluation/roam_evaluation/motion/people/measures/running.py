"""Running straight on: short windows, because captured runs are short."""

import numpy as np

from roam_evaluation.motion.people.frames import ANKLES, ELBOWS, HANDS, RATE, SHOULDERS, TOES, Motion
from roam_evaluation.motion.people.measures.posture import bends, foot_pitch, joint_contacts, lean
from roam_evaluation.motion.people.measures.walking import course, strikes

_WINDOW = 32  # frames: more than a stride of a runner, and what the shortest captured runs hold
_UPRIGHT = 0.70  # [m] hips
_SLOW = 1.1  # [m/s] a joint of a runner's foot in contact is slower (the captured set's own rule)
_OFF = 0.045  # [m] a toe joint so far over its lowest twentieth does not touch the floor


def windows(motion: Motion, speeds: tuple[float, float]) -> list[Motion]:
    """Windows in which somebody runs straight on at a speed within `speeds` [m/s]."""
    found, begin = [], 0
    while begin + _WINDOW < len(motion):
        part = motion.cut(begin, begin + _WINDOW)
        way = (part.hips[-1] - part.hips[0])[[0, 2]]
        pace = float(np.linalg.norm(way)) * RATE / _WINDOW
        aside = abs((np.arctan2(way[0], way[1]) - part.facing.mean() + np.pi) % (2 * np.pi) - np.pi)
        straight = np.ptp(part.facing) < np.radians(45) and aside < np.radians(25)
        struck = np.concatenate(strikes(part))
        if speeds[0] <= pace < speeds[1] and straight and part.hips[:, 1].min() > _UPRIGHT and len(struck) >= 2:
            found.append(part)
            begin += _WINDOW
        else:
            begin += 4
    return found


def airborne(positions: np.ndarray) -> np.ndarray:
    """Frames [T] in which neither toe joint touches the floor: both 4.5 cm over their own lowest twentieth."""
    height = positions[:, TOES, 1]
    return np.asarray((height > np.quantile(height, 0.05, axis=0) + _OFF).all(1))


def measure(motion: Motion) -> dict[str, float]:
    """All measures of one window of running."""
    positions, struck = motion.positions, strikes(motion)
    at = [(t, side) for side in (0, 1) for t in struck[side]]
    times = np.sort(np.concatenate(struck))
    pace = float(np.linalg.norm((motion.hips[-1] - motion.hips[0])[[0, 2]])) * RATE / (len(motion) - 1)
    cadence = 60 * RATE * (len(times) - 1) / float(times[-1] - times[0]) if times[-1] > times[0] else float("nan")
    knee, height = bends(positions), positions[:, 0, 1]
    hands = motion.ahead(positions[:, HANDS]) - motion.ahead(positions[:, SHOULDERS])
    ankles = motion.ahead(positions[:, ANKLES], course(motion))
    elbows = bends(positions, (SHOULDERS, ELBOWS, HANDS))
    phase = [np.corrcoef(hands[:, side], ankles[:, 1 - side])[0, 1] for side in (0, 1)]
    return {
        "cadence": cadence,
        "step_length": 100 * pace * 60 / cadence,
        "knee_at_strike": float(np.mean([knee[t, side] for t, side in at])),
        "knee_in_swing": float(knee.max(0).mean()),
        "hips_bob": 100
        * float(np.ptp(height - np.polyval(np.polyfit(range(len(height)), height, 1), range(len(height))))),
        "no_contact": 100 * float((~joint_contacts(positions, slower=_SLOW).any((1, 2))).mean()),
        "airborne": 100 * float(airborne(positions).mean()),
        "lean": float(lean(motion).mean()),
        "foot_pitch_range": float(np.ptp(foot_pitch(positions), axis=0).mean()),
        "arm_swing": 100 * float(np.ptp(hands, axis=0).mean()),
        "arm_phase": float(np.mean(phase)),
        "elbow": float(elbows.mean()),
        "speed": pace,
    }
