"""Synthetic people of known gait, twist and lean, for the tests of the measures."""

import numpy as np
from roam_character.pose import rest_pose
from roam_character.skeleton import humanoid_skeleton
from roam_evaluation.motion.people.frames import ANKLES, HANDS, KNEES, RATE, SHOULDERS, TOES, Motion, Stretch

REST = rest_pose(humanoid_skeleton()).positions().astype(float)


def standing(frames=100):
    """The rest pose, arms hanging."""
    positions = np.repeat(REST[None], frames, 0)
    for shoulder, hand in zip(SHOULDERS, HANDS, strict=True):
        positions[:, hand] = positions[:, shoulder] - [0, 0.52, 0]
    return positions


def walker(*, speed=0.9, cycle=36, seconds=6.0, swing=0.2, width=0.12, limp=0.0):
    """Walks along +Z: a foot stands for half a cycle (frames) and is carried ahead in the other.

    The step is then speed x cycle / 2 long; `limp` [m] puts the left foot down farther ahead.
    """
    frames = int(seconds * RATE)
    positions, t = standing(frames), np.arange(frames)
    hips = speed * t / RATE
    positions[..., 2] += hips[:, None]
    stride = speed * cycle / RATE
    for side in (0, 1):
        phase = (t / cycle + 0.5 * side) % 1
        count = np.floor(t / cycle + 0.5 * side)
        moved = np.clip((phase - 0.5) / 0.5, 0, 1)
        smooth = moved**2 * (3 - 2 * moved)
        foot = stride * (count - 0.5 * side + 0.25 + smooth) + (limp if side == 0 else 0.0)
        lift = 0.06 * np.sin(np.pi * moved)
        across = width / 2 * (1 if side == 0 else -1)
        shift = foot - positions[:, ANKLES[side], 2]
        for joint in (ANKLES[side], TOES[side]):
            positions[:, joint, 2] += shift
            positions[:, joint, 0] = across
            positions[:, joint, 1] += lift
        positions[:, KNEES[side]] = (positions[:, ANKLES[side]] + positions[:, KNEES[side]] * [1, 1, 0]) / 2
        positions[:, KNEES[side], 2] = hips + 0.5 * (foot - hips)
        hand = -0.5 * swing * np.cos(2 * np.pi * (phase - 0.0))
        positions[:, HANDS[side], 2] += hand
    return Motion("walker", "nobody", positions)


def turner(*, angle=90.0, frames=45, feet="stay"):
    """Stands, turns its body by an angle [degrees] in so many frames, stands; feet stay, or turn along."""
    positions = standing(60 + frames)
    share = np.clip((np.arange(60 + frames) - 30) / frames, 0, 1)
    yaw = np.radians(angle) * share**2 * (3 - 2 * share)
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, z = positions[..., 0].copy(), positions[..., 2].copy()
    turned = np.stack([x * c + z * s, positions[..., 1], -x * s + z * c], -1)
    if feet == "stay":
        turned[:, [*ANKLES, *TOES]] = positions[:, [*ANKLES, *TOES]]
    return Motion("turner", "nobody", turned)


def sitter(*, lean=45.0, drop=0.42, back=0.2, seconds=1.0, hold=90):
    """Stands a second, sinks by `drop` and back by `back` [m] while leaning forward [degrees], sits upright, rises."""
    down = int(seconds * RATE)
    share = np.concatenate(
        [np.zeros(30), np.linspace(0, 1, down), np.ones(hold), np.linspace(1, 0, down), np.zeros(30)]
    )
    smooth = share**2 * (3 - 2 * share)
    positions = standing(len(share))
    feet = positions[:, [*ANKLES, *TOES]].copy()
    positions[..., 1] -= drop * smooth[:, None]
    positions[..., 2] -= back * smooth[:, None]
    pitch = np.radians(lean) * np.sin(np.pi * np.where(share < 1, share, 0))
    upper = [j for j in range(22) if j not in (*ANKLES, *TOES, *KNEES, 14, 18)]
    pivot = positions[:, [14, 18]].mean(1, keepdims=True)
    offset = positions[:, upper] - pivot
    c, s = np.cos(pitch)[:, None], np.sin(pitch)[:, None]
    offset = np.stack(
        [offset[..., 0], offset[..., 1] * c - offset[..., 2] * s, offset[..., 1] * s + offset[..., 2] * c], -1
    )
    positions[:, upper] = pivot + offset
    positions[:, [*ANKLES, *TOES]] = feet
    first = 30 + down
    return Motion("sitter", "nobody", positions, (Stretch("sit held", first, first + hold - 1),))
