"""The same measures of real motion: what captured people do, beside which made motion is judged.

    python -m roam_evaluation.motion.clips --bvh DIR [--bvh DIR …] --json FILE

Only clips that training left out count as held out; the others stand in the comparison of real with real.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from roam_motion.animation.figure import CONTACT_JOINTS, Figure, humanoid_figure
from roam_motion.animation.state import FRAME_RATE
from roam_motion.training.data import labels
from roam_motion.training.data.library import LibraryConfig
from roam_motion.training.data.recordings import Recording, read_folder

from roam_evaluation.motion.measures import Track, frechet, motion_figures, walking_features

_FLOOR = ("sit-on-floor", "floor-sit", "lie-down", "lie", "get-up")  # not what is compared with


def read_tracks(figure: Figure, folders: Sequence[Path]) -> tuple[list[Track], list[Track]]:
    """Held-out and training recordings at 30 Hz."""
    held_out: list[Track] = []
    kept: list[Track] = []
    names = LibraryConfig(folders=()).held_out
    for folder in folders:
        for recording in read_folder(folder, figure.skeleton)[0]:
            if any(label in _FLOOR for label in recording.segments or ()):
                continue
            group = held_out if recording.name.split("/")[-1].startswith(names) else kept
            group.append(track_of(recording.at_rate(FRAME_RATE)))
    return held_out, kept


def track_of(recording: Recording) -> Track:
    """Positions, and contacts as training has them."""
    positions = recording.clip.positions()
    contacts = labels.find_contacts(positions, FRAME_RATE, recording.clip.skeleton.indices(CONTACT_JOINTS))
    if recording.ankle_contacts is not None:
        contacts[:, [0, 2]] = recording.ankle_contacts
    return Track(positions, contacts)


def features_of(figure: Figure, tracks: Sequence[Track]) -> np.ndarray:
    """Pose features of the walking frames of many tracks."""
    return np.concatenate([walking_features(figure, track) for track in tracks])


def main(argv: Sequence[str] | None = None) -> int:
    """Measures the clips."""
    parser = argparse.ArgumentParser(description="measures of captured motion")
    parser.add_argument("--bvh", type=Path, action="append", required=True, help="folder of BVH files (repeatable)")
    parser.add_argument("--json", type=Path, help="write the figures here")
    options = parser.parse_args(argv)
    torch.set_num_threads(1)
    figure = humanoid_figure()
    held_out, kept = read_tracks(figure, options.bvh)
    report = {
        "held_out_clips": len(held_out),
        "held_out": motion_figures(figure, held_out),
        "training_clips": len(kept),
        "training": motion_figures(figure, kept),
        "frechet_training_to_held_out": round(frechet(features_of(figure, kept), features_of(figure, held_out)), 2),
    }
    print(json.dumps(report, indent=1))
    if options.json:
        options.json.write_text(json.dumps(report, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
