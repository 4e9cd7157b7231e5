"""The blind test: can a plain classifier tell the product from captured people, by 1 s of bone directions alone?

What is no motion must not give anything away. All frames are on one skeleton; frames of both are sampled at the clips'
24 Hz and brought back to 30, low-passed at 5 Hz and seen at 10 Hz, so that neither frame rate nor noise tells; of the
joints only the directions of bones and how fast these turn are shown, in a frame that faces ahead at the middle of the
window: no heights, no place, no pace. Only bones that the captured figures have are shown: those that retargeting puts
half-way between others (chest, shoulders) would give the clips away. Persons and seeds of a test fold are not in its
training folds.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt
from sklearn.decomposition import PCA
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import balanced_accuracy_score
from sklearn.model_selection import StratifiedGroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from roam_evaluation.motion.people.frames import RATE, SIDES, SKELETON, Motion
from roam_evaluation.motion.people.measures import sitting, standing, walking

LIMIT = 75.0  # [%] balanced accuracy that may be reached
_CLIPS = 24.0  # [Hz] of the captured clips
_PASS = 5.0  # [Hz]
_SEEN = 3  # every third frame: 10 Hz
_WINDOW = 30  # frames: 1 s
_STEP = 15
_PARTS = 40  # principal components
_FEWEST = 20  # windows of either side
Group = tuple[np.ndarray, list[str]]  # features of windows [N, F], the person of each
_CHAINS = {  # bones that captured figures have, as pairs of joints
    "trunk": [("hips", "neck"), ("leftUpperLeg", "rightUpperLeg"), ("leftUpperArm", "rightUpperArm")],
    "head": [("neck", "head")],
    "arms": [(f"{s}{a}", f"{s}{b}") for s in SIDES for a, b in (("UpperArm", "LowerArm"), ("LowerArm", "Hand"))],
    "legs": [(f"{s}{a}", f"{s}{b}") for s in SIDES for a, b in (("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot"))],
    "feet": [(f"{s}Foot", f"{s}Toes") for s in SIDES],
}
_BONES = [SKELETON.indices(list(pair)) for chain in _CHAINS.values() for pair in chain]
_TIMES = _WINDOW // _SEEN


@dataclass(frozen=True)
class Blind:
    """How well the two are told apart."""

    kind: str
    people: int  # windows
    persons: int
    product: int  # windows
    seeds: int
    accuracy: float  # balanced, over all held-out folds [%]; 50 is guessing
    wide: float | None  # the same, with the people of training clips to learn from too, judged by the same windows [%]
    parts: dict[str, float]  # as `wide`, by a part of the body alone [%]
    control: float | None  # held-out people told from those of training clips [%]


def washed(positions: np.ndarray) -> np.ndarray:
    """Positions [T, J, 3] at 30 Hz as if captured at 24 Hz, low-passed at 5 Hz."""
    t = np.arange(len(positions)) / RATE
    coarse = np.arange(0, t[-1] + 1e-9, 1 / _CLIPS)
    back = _sampled(_sampled(positions, t, coarse), coarse, t)
    sos = butter(4, _PASS, fs=RATE, output="sos")
    return np.asarray(sosfiltfilt(sos, back, axis=0, padlen=min(30, len(back) - 2)))


def _sampled(values: np.ndarray, times: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Linear interpolation of values [T, …] at wanted times."""
    at = np.interp(wanted, times, np.arange(len(times)))
    low = np.minimum(at.astype(int), len(times) - 2)
    share = (at - low).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[low] * (1 - share) + values[low + 1] * share)


def features(window: Motion) -> np.ndarray:
    """Bone directions, and how they change, of a window of 1 s at 10 Hz, facing ahead in its middle."""
    yaw = window.facing[len(window) // 2]
    c, s = np.cos(yaw), np.sin(yaw)
    p = window.positions
    turned = np.stack([p[..., 0] * c - p[..., 2] * s, p[..., 1], p[..., 0] * s + p[..., 2] * c], -1)
    bones = np.stack([turned[:, joint] - turned[:, parent] for parent, joint in _BONES], 1)
    bones = bones / np.linalg.norm(bones, axis=-1, keepdims=True)
    speeds = np.linalg.norm(np.gradient(bones, axis=0), axis=-1) * RATE
    return np.concatenate([bones[::_SEEN].ravel(), speeds[::_SEEN].ravel()])


def _cut(motion: Motion, first: int, last: int) -> list[Motion]:
    return [motion.cut(a, a + _WINDOW - 1) for a in range(first, last - _WINDOW + 2, _STEP)]


def walks(motion: Motion) -> list[Motion]:
    """Windows of straight walking at 0.7-1.35 m/s."""
    found = walking.windows(motion, (0.7, 1.35))
    return [part for window in found for part in _cut(window, 0, len(window) - 1)]


def seats(motion: Motion) -> list[Motion]:
    """Windows of sitting, a second after the way down and before the way up."""
    found: list[Motion] = []
    for sit in sitting.sits(motion):
        found += _cut(motion, *sitting.seated(sit))
    return found


def idles(motion: Motion) -> list[Motion]:
    """Windows of standing."""
    return [part for window in standing.idles(motion) for part in _cut(window, 0, len(window) - 1)]


KINDS: dict[str, Callable[[Motion], list[Motion]]] = {"walking": walks, "sitting": seats, "idle": idles}


def blind_test(
    product: Sequence[Motion], held_out: Sequence[Motion], training: Sequence[Motion], *, seed: int = 0
) -> list[Blind]:
    """Every kind of motion that both have enough of."""
    asked = [m for m in product if m.told in ("sit", "idle", "steer 0.9", "steer 1.2")]
    found = []
    for kind, find in KINDS.items():
        ours, people, others = (_windows(group, find) for group in (asked, held_out, training))
        if min(len(ours[0]), len(people[0])) >= _FEWEST:
            known = len(others[0]) >= _FEWEST
            found.append(
                Blind(
                    kind=kind,
                    people=len(people[0]),
                    persons=len(set(people[1])),
                    product=len(ours[0]),
                    seeds=len(set(ours[1])),
                    accuracy=told_apart(ours, people, seed=seed),
                    wide=told_apart(ours, people, seed=seed, more=others[0]) if known else None,
                    parts={part: _by_part(part, ours, people, others if known else None, seed) for part in _CHAINS},
                    control=told_apart(others, people, seed=seed) if known else None,
                )
            )
    return found


def _by_part(part: str, ours: Group, people: Group, others: Group | None, seed: int) -> float:
    """Accuracy by one part of the body alone."""
    first, second = _only(part, ours), _only(part, people)
    return told_apart(first, second, seed=seed, more=_only(part, others)[0] if others else None)


def _only(part: str, group: Group) -> Group:
    """Features of one part of the body."""
    names = [name for name, chain in _CHAINS.items() for _ in chain]
    own = np.array([name == part for name in names])
    columns = np.concatenate([np.tile(np.repeat(own, 3), _TIMES), np.tile(own, _TIMES)])
    return group[0][:, columns], group[1]


def _windows(motions: Sequence[Motion], find: Callable[[Motion], list[Motion]]) -> Group:
    """Features [N, F] and the person of each window."""
    rows, persons = [], []
    for motion in motions:
        clean = Motion(motion.name, motion.person, washed(motion.positions), motion.stretches, motion.told)
        for window in find(clean):
            rows.append(features(window))
            persons.append(motion.person)
    return np.array(rows), persons


def told_apart(
    first: Group,
    second: Group,
    *,
    seed: int = 0,
    more: np.ndarray | None = None,
) -> float:
    """Balanced accuracy [%] of a logistic regression, over folds that share no person.

    `more` windows of the second kind [M, F] are learned from in every fold and judged in none.
    """
    values = np.concatenate([first[0], second[0]])
    target = np.repeat([0, 1], [len(first[0]), len(second[0])])
    persons = [f"first {who}" for who in first[1]] + [f"second {who}" for who in second[1]]
    folds = max(2, min(5, len(set(first[1])), len(set(second[1]))))
    guessed = np.empty(len(target), int)
    for fit, test in StratifiedGroupKFold(folds, shuffle=True, random_state=seed).split(values, target, persons):
        parts = min(_PARTS, len(fit) - 1, values.shape[1])
        model = make_pipeline(
            StandardScaler(),
            PCA(parts, random_state=seed),
            LogisticRegression(C=0.1, class_weight="balanced", max_iter=2000),
        )
        seen, known = values[fit], target[fit]
        if more is not None:
            seen, known = np.concatenate([seen, more]), np.concatenate([known, np.ones(len(more), int)])
        guessed[test] = model.fit(seen, known).predict(values[test])
    return 100 * float(balanced_accuracy_score(target, guessed))
