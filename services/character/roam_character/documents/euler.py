"""Euler angles for files that store them: exact at every angle, and without jumps from row to row.

A rotation has two solutions in every order of axes, each with full turns added at will; the one nearest the row before
is taken. Where the middle angle is ±90° the outer two turn about one line: the first keeps its value. A joint whose
rows would still leap in the usual order gets another order of axes.
"""

import itertools

import numpy as np

from roam_character.rotation import quat_to_matrix

ORDERS = ("ZXY", *(o for o in map("".join, itertools.permutations("XYZ")) if o != "ZXY"))
_QUIET = np.radians(30.0)  # largest step that nobody needs to improve on: half of what readers show as a jump


def euler_rows(rotations: np.ndarray) -> tuple[np.ndarray, str]:
    """Angles [T, 3] [rad] of R = R_a(α) R_b(β) R_c(γ) and the order "abc" for one joint's quaternions [T, 4]."""
    best: tuple[float, np.ndarray, str] | None = None
    for order in ORDERS:
        angles = continuous_angles(rotations, order)
        step = float(np.abs(np.diff(angles, axis=0)).max()) if len(angles) > 1 else 0.0
        if best is None or step < best[0] - 1e-9:
            best = step, angles, order
        if step <= _QUIET:
            break
    assert best is not None
    return best[1], best[2]


def continuous_angles(rotations: np.ndarray, order: str) -> np.ndarray:
    """Angles [T, 3] [rad] in one order of axes, each row the solution nearest the one before."""
    matrices = quat_to_matrix(np.asarray(rotations, float))
    a, b, c = ("XYZ".index(axis) for axis in order)
    sign = 1.0 if (b - a) % 3 == 1 else -1.0
    sine = np.clip(sign * matrices[:, a, c], -1, 1)
    cosine = np.hypot(matrices[:, a, a], matrices[:, a, b])
    middle = np.arctan2(sine, cosine)
    first = np.arctan2(-sign * matrices[:, b, c], matrices[:, c, c])
    last = np.arctan2(-sign * matrices[:, a, b], matrices[:, a, a])
    # At ±90° only the sum or the difference of the outer angles shows: it is read off the other entries.
    locked = np.arctan2(sign * matrices[:, c, b], matrices[:, b, b])
    rows = np.zeros((len(matrices), 3))
    before = np.zeros(3)
    for i in range(len(matrices)):
        if cosine[i] < 1e-6:
            turn = before[0]
            rest = locked[i] - turn if sine[i] * sign > 0 else turn - locked[i]
            candidates = [np.array([turn, middle[i], rest])]
        else:
            one = np.array([first[i], middle[i], last[i]])
            candidates = [one, np.array([one[0] + np.pi, np.pi - one[1], one[2] + np.pi])]
        candidates = [v + 2 * np.pi * np.round((before - v) / (2 * np.pi)) for v in candidates]
        before = min(candidates, key=lambda v: float(np.abs(v - before).max()))
        rows[i] = before
    return rows
