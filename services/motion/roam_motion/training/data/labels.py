"""Labels found from the motion itself: contacts, sitting and lying spans, gait phase, soft action labels."""

import numpy as np
from roam_character.clip import Clip

from roam_motion.actions import IDLE, STYLES
from roam_motion.animation.figure import CONTACT_JOINTS

# Contact: a foot joint this low and this slow starts to count, and counts until it is higher or faster than the second
# pair (hysteresis). Ankles stand 8 cm, toe joints 2.5 cm above the sole.
_ANKLE = ((0.13, 0.20), (0.16, 0.45))  # ([m], [m/s])
_TOES = ((0.055, 0.25), (0.075, 0.55))
_LONGEST_CYCLE = 4.0  # [s] a gait phase wraps at the latest after this long
_RAMP = 0.5  # [s] soft labels go from 0 to 1 in this time

LOCOMOTION = ("idle", "walk", "turn", "jog", "run", "sneak")  # labels of going about and standing about
_ACTION_OF = {
    "idle": "idle",
    "walk": "walk",
    "turn": "walk",
    "jog": "walk",  # how fast is told by the root's path
    "run": "walk",
    "sneak": "walk",
    "sit-down": "sit",
    "sit": "sit",
    "stand-up": "sit",
    "lie-down": "lie",
    "lie": "lie",
    "get-up": "lie",
}


def find_contacts(positions: np.ndarray, frame_rate: float, joints: list[int]) -> np.ndarray:
    """Contacts [T, 4] bool of the joints (ankle, toes, ankle, toes) at positions [T, J, 3]."""
    track = positions[:, joints]
    speed = np.linalg.norm(np.gradient(track, axis=0), axis=-1) * frame_rate
    height = track[..., 1]
    out = np.zeros(height.shape, bool)
    for column in range(len(joints)):
        on, off = _TOES if column % 2 else _ANKLE
        held = False
        for t in range(len(track)):
            limit = off if held else on
            held = bool(height[t, column] < limit[0] and speed[t, column] < limit[1])
            out[t, column] = held
    return out


def find_spans(clip: Clip) -> list[tuple[str, int | None, int, int, int | None]]:
    """Sitting and lying spans (action, down, first, last, up) from hip height, thigh angle and trunk angle."""
    names = clip.skeleton
    positions = clip.positions()
    hips = positions[:, 0, 1]
    standing = float(np.quantile(hips, 0.9))
    thighs = (
        positions[:, names.indices(["leftLowerLeg", "rightLowerLeg"])]
        - positions[:, names.indices(["leftUpperLeg", "rightUpperLeg"])]
    )
    level = np.abs(thighs[..., 1] / np.linalg.norm(thighs, axis=-1)).min(1) < 0.6
    trunk = positions[:, names.index("neck")] - positions[:, 0]
    flat = trunk[:, 1] / np.linalg.norm(trunk, axis=-1) < 0.4
    low = (hips < 0.8 * standing) & (hips > 0.3 * standing)
    still = np.abs(np.gradient(hips)) * clip.frame_rate < 0.15
    spans: list[tuple[str, int | None, int, int, int | None]] = []
    for action, held in (("lie", low & flat & still), ("sit", low & level & ~flat & still)):
        for first, last in _runs(held, int(0.4 * clip.frame_rate)):
            upright = hips > 0.93 * standing
            before, after = np.flatnonzero(upright[:first]), np.flatnonzero(upright[last:])
            spans.append(
                (
                    action,
                    int(before[-1]) if len(before) else None,
                    first,
                    last,
                    int(after[0]) + last if len(after) else None,
                )
            )
    return spans


def _runs(mask: np.ndarray, shortest: int) -> list[tuple[int, int]]:
    """First and last index of every run of True at least `shortest` long."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= shortest]


def find_phase(contacts: np.ndarray, frame_rate: float) -> np.ndarray:
    """Gait phase [T] in turns, unwrapped: linear between onsets of left-foot contact, at most 4 s per turn."""
    left = contacts[:, CONTACT_JOINTS.index("leftFoot")]
    onsets = [int(t) for t in np.flatnonzero(left[1:] & ~left[:-1]) + 1]
    longest = int(_LONGEST_CYCLE * frame_rate)
    # The clip's ends count as keys one typical cycle away.
    cycle = int(np.clip(np.median(np.diff(onsets)), 15, longest)) if len(onsets) > 1 else longest
    keys = [-cycle, *onsets] if onsets else [-cycle]
    filled = [keys[0]]
    for key in [*keys[1:], len(left) + cycle]:
        gap = key - filled[-1]
        pieces = max(1, int(np.ceil(gap / longest)))
        filled += [filled[-1] + round(gap * (i + 1) / pieces) for i in range(pieces)]
    distinct = sorted(set(filled))
    return np.interp(np.arange(len(left)), distinct, np.arange(len(distinct))).astype(np.float32)


def soft_actions(names: list[str], frame_rate: float) -> np.ndarray:
    """Soft labels [T, 4] in the order of STYLES: one-hot segments with linear ramps."""
    hard = np.zeros((len(names), len(STYLES)), np.float32)
    for t, name in enumerate(names):
        hard[t, STYLES.index(_ACTION_OF.get(name, IDLE.style))] = 1
    width = max(1, int(_RAMP * frame_rate))
    padded = np.pad(hard, ((width // 2, width - 1 - width // 2), (0, 0)), mode="edge")
    kernel = np.ones(width, np.float32) / width
    return np.stack([np.convolve(padded[:, i], kernel, "valid") for i in range(hard.shape[1])], 1)


def moving(roots: np.ndarray, yaw: np.ndarray, frame_rate: float) -> list[str]:
    """`walk` or `idle` per frame from root positions [T, 2] and unwrapped yaw [T], for clips without a table."""
    speed = np.linalg.norm(np.gradient(roots, axis=0), axis=-1) * frame_rate
    turning = np.abs(np.gradient(yaw)) * frame_rate
    width = max(1, int(0.3 * frame_rate))
    busy = np.convolve((speed > 0.25) | (turning > 0.7), np.ones(width) / width, "same") > 0.5
    return ["walk" if b else "idle" for b in busy]
