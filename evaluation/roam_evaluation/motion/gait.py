"""How somebody walks who walks straight on: what of it is large, what is small, beside captured people.

Whole motions differ in what they do, and so do distances between them: a character that only walks up to chairs at one
speed is far from people who stroll, turn and hurry. These measures compare like with like: upright, straight on,
forward, at the speed that approaches are walked at.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
import torch
from roam_motion.animation.figure import Figure
from roam_motion.animation.state import FRAME_RATE

from roam_evaluation.motion.measures import Track, frechet, walking_features

SPEED = 0.7, 1.0  # [m/s]
_WINDOW = 36  # frames: about one stride
_STRAIGHT = 0.35  # [rad] the facing turns at most
_FORWARD = 0.5  # [rad] between way and facing
_UPRIGHT = 0.8  # [m] hips


@dataclass(frozen=True)
class Gait:
    """One window of steady walking. Centimetres and degrees."""

    arm_swing: float  # way of a hand forth and back, from its shoulder
    stride: float  # of an ankle, in the root's frame
    foot_lift: float
    hip_bob: float
    hip_height: float
    trunk_twist: float


def steady(figure: Figure, track: Track) -> list[Track]:
    """The windows of a track in which it walks straight on."""
    positions = torch.tensor(track.positions, dtype=torch.float32)
    facing = figure.frame(positions).direction.numpy()
    yaw = np.unwrap(np.arctan2(facing[:, 0], facing[:, 1]))
    found = []
    for begin in range(0, len(yaw) - _WINDOW, _WINDOW):
        part = slice(begin, begin + _WINDOW + 1)
        hips = track.positions[part, 0]
        way = (hips[-1] - hips[0])[[0, 2]]
        aside = np.arctan2(way[0], way[1]) - yaw[part].mean()
        aside = abs((aside + np.pi) % (2 * np.pi) - np.pi)
        speed = np.linalg.norm(way) * FRAME_RATE / _WINDOW
        turned = abs(yaw[begin + _WINDOW] - yaw[begin])
        if SPEED[0] <= speed < SPEED[1] and turned < _STRAIGHT and aside < _FORWARD and hips[:, 1].min() > _UPRIGHT:
            found.append(Track(track.positions[part], track.contacts[part]))
    return found


def gait(figure: Figure, window: Track) -> Gait:
    """The measures of one window."""
    positions = torch.tensor(window.positions, dtype=torch.float32)
    local = 100 * figure.frame(positions).points_in(positions).numpy()
    names = figure.skeleton
    hands, shoulders, ankles = (
        local[:, names.indices([f"left{part}", f"right{part}"])] for part in ("Hand", "UpperArm", "Foot")
    )
    across = shoulders[:, 0] - shoulders[:, 1]
    return Gait(
        arm_swing=float(np.ptp((hands - shoulders)[..., 2], axis=0).mean()),
        stride=float(np.ptp(ankles[..., 2], axis=0).mean()),
        foot_lift=float(np.ptp(ankles[..., 1], axis=0).mean()),
        hip_bob=float(np.ptp(local[:, 0, 1])),
        hip_height=float(local[:, 0, 1].mean()),
        trunk_twist=float(np.degrees(np.ptp(np.arctan2(across[:, 2], across[:, 0])))),
    )


def gait_figures(figure: Figure, windows: Sequence[Track]) -> dict[str, float | list[float]]:
    """Mean and deviation of the measures over windows."""
    if not windows:
        return {"windows": 0}
    found = [asdict(gait(figure, window)) for window in windows]
    columns = {name: np.array([one[name] for one in found]) for name in found[0]}
    figures = {name: [round(float(x.mean()), 2), round(float(x.std()), 2)] for name, x in columns.items()}
    return {"windows": len(windows), **figures}


def beside(
    figure: Figure, made: Sequence[Track], held_out: Sequence[Track], kept: Sequence[Track]
) -> dict[str, object]:
    """Steady walking that was made beside that of held-out clips and of training clips."""
    groups = {"made": made, "held_out_clips": held_out, "training_clips": kept}
    windows = {name: [w for track in tracks for w in steady(figure, track)] for name, tracks in groups.items()}
    report: dict[str, object] = {name: gait_figures(figure, found) for name, found in windows.items()}
    if all(windows.values()):
        features = {n: np.concatenate([walking_features(figure, w) for w in found]) for n, found in windows.items()}
        for name in ("made", "training_clips"):
            report[f"frechet_of_{name}"] = round(frechet(features[name], features["held_out_clips"]), 2)
    return report
