"""Standing about, setting off and stopping."""

import numpy as np

from roam_evaluation.motion.people.frames import ANKLES, HANDS, HEAD, HIPS, RATE, Motion
from roam_evaluation.motion.people.measures.posture import bends, centre_of_mass, lean, runs, smooth, twist

_STILL = 0.12  # [m/s] of the hips along the floor, over half a second: stands
_WALKS = 0.60  # [m/s]
_UPRIGHT = 0.78  # [m] hips
_BENT = 30.0  # [degrees] who leans farther does something else than walk or stand
_WINDOW = 60  # frames: 2 s
_FAR = 45  # frames within which a walk must have become a stand, or a stand a walk


def pace(motion: Motion) -> np.ndarray:
    """Speed of the hips along the floor [T] [m/s], over half a second."""
    return smooth(np.linalg.norm(np.gradient(motion.hips[:, [0, 2]], axis=0), axis=-1) * RATE, 15)


def idles(motion: Motion) -> list[Motion]:
    """Windows of 2 s in which somebody stands, not turning."""
    turning = np.abs(smooth(np.gradient(motion.pelvis) * RATE, 15)) > np.radians(20)
    stands = (pace(motion) < _STILL) & (motion.positions[:, HIPS, 1] > _UPRIGHT) & ~turning
    return [
        motion.cut(begin, begin + _WINDOW - 1)
        for first, last in runs(stands, _WINDOW)
        for begin in range(first, last - _WINDOW + 2, _WINDOW)
    ]


def measure_idle(motion: Motion) -> dict[str, float]:
    """Measures of two seconds of standing."""
    spreads = 100 * np.sqrt(((motion.positions - motion.positions.mean(0)) ** 2).sum(-1).mean(0))
    return {
        "idle_hips": float(spreads[HIPS]),
        "idle_head": float(spreads[HEAD]),
        "idle_hands": float(spreads[HANDS].mean()),
        **_stance(motion, len(motion) // 2),
    }


def _stance(motion: Motion, frame: int) -> dict[str, float]:
    """How somebody stands at a frame."""
    positions = motion.positions
    ankles, knees = motion.positions[frame, ANKLES], bends(positions)[frame]
    ahead = motion.ahead(np.stack([centre_of_mass(positions), positions[:, ANKLES].mean(1)], 1))[frame]
    return {
        "knees": float(knees.mean()),
        "lean": float(lean(motion)[frame]),
        "feet_apart": 100 * float(np.linalg.norm((ankles[0] - ankles[1])[[0, 2]])),
        "balance": 100 * float(ahead[0] - ahead[1]),
        "twist": float(np.nan_to_num(twist(motion)[frame]).max()),
    }


def stops(motion: Motion) -> list[int]:
    """Frames at which walking has become standing that lasts a second or more.

    Captured people who then bend to something do something else; the product, told to stand, has no reason to.
    """
    speed, upright = pace(motion), motion.positions[:, HIPS, 1] > _UPRIGHT
    if not motion.told:
        upright &= lean(motion) < _BENT
    found = []
    for first, last in runs(speed < _STILL, 30):
        before = slice(max(first - _FAR, 0), first)
        walked = len(speed[before]) > 0 and speed[before].max() > _WALKS and upright[before].all()
        if walked and (motion.told or upright[first:last].all()):
            found.append(first)
    return found


def measure_stop(motion: Motion, frame: int) -> dict[str, float]:
    """Measures of a stop: how long it takes, the stance two thirds of a second after it, the bow within two seconds."""
    fast = np.flatnonzero(pace(motion)[:frame] > _WALKS)
    return {
        "stopping": (frame - int(fast[-1])) / RATE,
        "lean_most": float(lean(motion)[frame : frame + 60].max()),
        **_stance(motion, min(frame + 20, len(motion) - 1)),
    }


def starts(motion: Motion) -> list[int]:
    """Last frames of standing, of half a second or more, before walking; not of rising from a seat."""
    speed, upright, bent = pace(motion), motion.positions[:, HIPS, 1] > _UPRIGHT, lean(motion) > _BENT
    found = []
    for first, last in runs((speed < _STILL) & upright, 15):
        after = speed[last + 1 : last + _FAR]
        if len(after) and after.max() > _WALKS and (upright & ~bent)[max(first - _FAR, 0) : last + _FAR].all():
            found.append(last)
    return found


def measure_start(motion: Motion, frame: int) -> dict[str, float]:
    """Measures of setting off: how long it takes, which way the body leans and shifts, the first step."""
    end = frame + 1 + int(np.flatnonzero(pace(motion)[frame + 1 : frame + _FAR] > _WALKS)[0])
    ankles = motion.positions[:, ANKLES]
    way = np.linalg.norm((ankles[frame:end] - ankles[frame])[..., [0, 2]], axis=-1).max(0)
    aside = motion.cut(frame, end)
    hips = aside.hips - aside.hips[0]
    turn = aside.facing[0]
    shift = hips[:, 0] * np.cos(turn) - hips[:, 2] * np.sin(turn)
    return {
        "starting": (end - frame) / RATE,
        "lean_starting": float(lean(motion)[frame : end + 10].max()),
        "first_step": 100 * float(way.max()),
        "other_foot": 100 * float(way.min()),
        "shift_aside": 100 * float(np.abs(shift).max()),
    }
