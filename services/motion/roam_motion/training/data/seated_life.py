"""What captured people do while they sit, as a table that the living idle plays: `animation/shown/seated_life.npz`.

    python -m roam_motion.training.data.seated_life --bvh DIR --heldout FILE

Of every sitting stretch: how the bones of the trunk are turned, and hips and wrists moved, from where they are over
some seconds. Whole movements from one posture to another fade, since a goal pose is to be held; what people do within a
few seconds stays. Clips that are held out are left out. The data used in this project were obtained from
mocap.cs.cmu.edu, created with funding from NSF EIA-0196217.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from roam_character.skeleton import humanoid_skeleton

from roam_motion.animation.figure import Figure, humanoid_figure
from roam_motion.animation.shown.seated_life import BONES, RATE, TABLE, WRISTS
from roam_motion.training.data.recordings import Recording, read_folder

_FRAMES = 30.0  # [Hz] of the clips here
_EDGE = 20  # frames at both ends of a stretch that still belong to sitting down or rising
_SHORTEST = 75  # frames of a stretch that is of use
_SLOW = 60  # frames: deviation of the window over which the posture is averaged
_MOST = {"turns": 0.16, "hips": 0.006, "wrists": 0.06}  # [rad], [m]: larger deviations are compressed towards these
_FADE = 15  # frames between two stretches
_LEVELS = 127


def stretches(figure: Figure, recordings: Sequence[Recording]) -> list[np.ndarray]:
    """Deviations [T, C] of every sitting stretch: turns of `BONES` [rad], then hips and wrists [m]."""
    found = []
    for recording in recordings:
        clip = recording.at_rate(_FRAMES)
        for span in clip.spans:
            first, last = span.first + _EDGE, span.last - _EDGE
            if span.action == "sit" and last - first >= _SHORTEST:
                found.append(_deviations(figure, clip, first, last))
    return found


def _deviations(figure: Figure, recording: Recording, first: int, last: int) -> np.ndarray:
    clip = recording.clip
    positions = torch.tensor(clip.positions()[first:last], dtype=torch.float32)
    local = torch.tensor(_matrices(clip.rotations[first:last]), dtype=torch.float32)
    frame = figure.frame(positions.mean(0, keepdim=True))
    turned = frame.points_in(positions.flatten(0, 1)[None])[0].reshape(positions.shape)
    space = frame._space[0]
    bones = space.T @ figure.world(local)[:, figure.skeleton.indices(list(BONES))]
    mean = _mean(bones)
    turns = _vectors((bones @ mean.mT).numpy())
    hips = turned[:, 0].numpy()
    wrists = turned[:, figure.skeleton.indices(list(WRISTS))].numpy()
    parts = {"turns": turns, "hips": hips[:, None], "wrists": wrists}
    kept = [_compressed(_within(value), _MOST[name]) for name, value in parts.items()]
    return np.concatenate([value.reshape(len(turns), -1) for value in kept], 1)


def _matrices(quaternions: np.ndarray) -> np.ndarray:
    from roam_character.rotation import quat_to_matrix

    return np.asarray(quat_to_matrix(torch.tensor(np.asarray(quaternions, np.float32))))


def _mean(rotations: torch.Tensor) -> torch.Tensor:
    """The mean [K, 3, 3] of rotations [T, K, 3, 3]: nearest to their mean matrix."""
    u, _, v = torch.linalg.svd(rotations.mean(0))
    return u @ v


def _vectors(rotations: np.ndarray) -> np.ndarray:
    """Rotation vectors [..., 3] of small rotations [..., 3, 3]."""
    skew = 0.5 * (rotations - rotations.swapaxes(-1, -2))
    vector = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], -1)
    sine = np.linalg.norm(vector, axis=-1, keepdims=True)
    return vector * np.arcsin(sine.clip(0, 1)) / np.maximum(sine, 1e-9)


def _within(values: np.ndarray) -> np.ndarray:
    """What is left of values [T, …] when their course over some seconds is taken away."""
    times = np.arange(len(values))
    weights = np.exp(-0.5 * ((times[:, None] - times[None]) / _SLOW) ** 2)
    weights /= weights.sum(1, keepdims=True)
    return np.asarray(values - np.tensordot(weights, values, 1))


def _compressed(values: np.ndarray, most: float) -> np.ndarray:
    """Vectors [..., 3] shorter than `most`."""
    length = np.linalg.norm(values, axis=-1, keepdims=True)
    return np.asarray(values * most * np.tanh(length / most) / np.maximum(length, 1e-9))


def table(parts: Sequence[np.ndarray], *, seed: int = 0) -> np.ndarray:
    """All stretches in random order one after the other, each fading in and out, at `RATE` [N, C]."""
    order = np.random.default_rng(seed).permutation(len(parts))
    rows = []
    for part in (parts[i] for i in order):
        ramp = np.minimum(np.arange(len(part)), np.arange(len(part))[::-1]) / _FADE
        ramp = np.clip(ramp, 0.0, 1.0)
        rows.append(part * (ramp * ramp * (3 - 2 * ramp))[:, None])
    whole = np.concatenate(rows)
    smooth = np.apply_along_axis(lambda column: np.convolve(column, (0.25, 0.5, 0.25), "same"), 0, whole)
    return np.asarray(smooth[:: round(_FRAMES / RATE)])


def write(path: Path, values: np.ndarray) -> None:
    """As bytes, with a scale for every column."""
    scale = np.maximum(np.abs(values).max(0), 1e-6) / _LEVELS
    np.savez_compressed(path, values=np.round(values / scale).astype(np.int8), scale=scale.astype(np.float32))


def main(argv: Sequence[str] | None = None) -> int:
    """Makes the table anew."""
    parser = argparse.ArgumentParser(description="the table of what captured people do while they sit")
    parser.add_argument("--bvh", type=Path, action="append", required=True, help="folder of clips (repeatable)")
    parser.add_argument("--heldout", type=Path, required=True, help="prefixes of clips that are left out")
    parser.add_argument("--out", type=Path, default=TABLE)
    options = parser.parse_args(argv)
    lines = options.heldout.read_text().splitlines()
    left_out = tuple(line.strip() for line in lines if line.strip() and not line.startswith("#"))
    figure, recordings = humanoid_figure(), []
    for folder in options.bvh:
        recordings += read_folder(folder, humanoid_skeleton())[0]
    kept = [r for r in recordings if not Path(r.name).name.startswith(left_out)]
    parts = stretches(figure, kept)
    values = table(parts)
    write(options.out, values)
    print(f"{len(parts)} stretches, {len(values) / RATE:.0f} s")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
