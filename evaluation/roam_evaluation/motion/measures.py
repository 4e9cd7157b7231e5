"""What is measured of a motion, made or captured: jumps, slides of planted feet, jerk, speed, how its poses spread."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from roam_motion.animation.figure import Figure
from roam_motion.animation.state import FRAME_RATE

_WALKING = 0.3  # [m/s] root speed from which a frame counts as walking
_UPRIGHT = 0.8  # [m] hips of somebody who walks: hips that sit down or rise are as fast


@dataclass(frozen=True, eq=False)
class Track:
    """T frames of a motion at 30 Hz."""

    positions: np.ndarray  # [T, J, 3] [m]
    contacts: np.ndarray  # [T, 4] bool: ankle, toes, ankle, toes


def jumps(track: Track) -> np.ndarray:
    """Largest way of any joint between two frames [T - 1] [m]."""
    return np.linalg.norm(np.diff(track.positions, axis=0), axis=-1).max(-1)


def slides(figure: Figure, track: Track) -> tuple[list[float], list[float]]:
    """Horizontal way of the joint in every contact [m]: of ankles, of toe joints."""
    feet = track.positions[:, figure.contacts.numpy()][..., [0, 2]]
    moved = np.linalg.norm(np.diff(feet, axis=0), axis=-1)
    both = track.contacts[1:] & track.contacts[:-1]
    out: tuple[list[float], list[float]] = ([], [])
    for column in range(both.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], both[:, column].astype(int), [0]])))
        out[column % 2].extend(float(moved[a:b, column].sum()) for a, b in zip(edges[::2], edges[1::2], strict=True))
    return out


def jerk(track: Track) -> float:
    """Mean jerk of all joints [m/s^3]."""
    return float(np.linalg.norm(np.diff(track.positions, n=3, axis=0), axis=-1).mean() * FRAME_RATE**3)


def speeds(track: Track) -> np.ndarray:
    """Speed of the hips over the floor [T - 10] [m/s], over a third of a second."""
    hips = track.positions[:, 0, [0, 2]]
    return np.asarray(np.linalg.norm(hips[10:] - hips[:-10], axis=-1) * FRAME_RATE / 10)


def walking_features(figure: Figure, track: Track) -> np.ndarray:
    """Joints and their velocities in the root's frame [N, 6 J] [m], [m/s], of the frames that walk upright."""
    walks = np.flatnonzero(speeds(track) > _WALKING) + 5
    walks = walks[track.positions[walks, 0, 1] > _UPRIGHT]
    positions = torch.tensor(track.positions[walks], dtype=torch.float32)
    moved = torch.tensor(track.positions[walks] - track.positions[walks - 1], dtype=torch.float32) * FRAME_RATE
    frame = figure.frame(positions)
    return torch.cat([frame.points_in(positions).flatten(1), frame.turn_in(moved).flatten(1)], 1).numpy()


def frechet(a: np.ndarray, b: np.ndarray) -> float:
    """Fréchet distance of the normal distributions of features [N, F] and [M, F], of unit deviation in `b`."""
    scale = b.std(0) + 1e-2
    a, b = a / scale, b / scale
    first, second = np.cov(a, rowvar=False), np.cov(b, rowvar=False)
    # The trace of a root of a product of two covariances: its eigenvalues are real and not negative.
    roots = np.sqrt(np.linalg.eigvals(first @ second).real.clip(0.0))
    return float(((a.mean(0) - b.mean(0)) ** 2).sum() + np.trace(first + second) - 2 * roots.sum())


def motion_figures(figure: Figure, tracks: Sequence[Track]) -> dict[str, float]:
    """The measures of many motions that need no goal, in centimetres and SI units."""
    both = [slides(figure, track) for track in tracks]
    ankle, toes = ([slide for pair in both for slide in pair[kind]] for kind in (0, 1))
    steps, pace = (np.concatenate([measure(track) for track in tracks]) for measure in (jumps, speeds))
    pace = pace[pace > _WALKING]
    return {
        "largest_jump_cm": round(100 * float(steps.max()), 2),
        "jump_p999_cm": round(100 * float(np.quantile(steps, 0.999)), 2),
        "ankle_slide_cm_mean": round(100 * float(np.mean(ankle)), 3),
        "ankle_slide_cm_p95": round(100 * float(np.quantile(ankle, 0.95)), 3),
        "toe_slide_cm_mean": round(100 * float(np.mean(toes)), 3),
        "toe_slide_cm_p95": round(100 * float(np.quantile(toes, 0.95)), 3),
        "jerk_m_s3": round(float(np.mean([jerk(t) for t in tracks])), 1),
        "walking_speed_m_s_p5": round(float(np.quantile(pace, 0.05)), 2),
        "walking_speed_m_s_median": round(float(np.median(pace)), 2),
        "walking_speed_m_s_p95": round(float(np.quantile(pace, 0.95)), 2),
    }
