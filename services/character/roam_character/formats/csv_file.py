"""CSV of poses and motions: one row a frame, for spreadsheets and statistics.

Columns: `frame`, `time` [s], then for every joint its world position `NAME.x NAME.y NAME.z` [m] and its local rotation
`NAME.qx NAME.qy NAME.qz NAME.qw`. With a character the joints are the file's own, rotations away from its T-pose.
"""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roam_character.formats.registry import Format
from roam_character.formats.scene import Scene
from roam_character.retargeting.rig_clip import rig_clip


def write(path: Path, scene: Scene) -> Sequence[str]:
    """Writes the joints of a scene, six decimals."""
    clip = scene.clip if scene.character is None else rig_clip(scene.character)
    names = clip.skeleton.joint_names
    parts = ("x", "y", "z", "qx", "qy", "qz", "qw")
    rows = np.concatenate([clip.positions(), clip.rotations], axis=-1).reshape(len(clip), -1)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["frame", "time", *(f"{name}.{part}" for name in names for part in parts)])
        for frame, row in enumerate(rows):
            writer.writerow([frame, f"{frame / clip.frame_rate:.6f}", *(f"{value:.6f}" for value in row)])
    return ("CSV holds joints only: no mesh, no furniture",)


FORMAT = Format("csv", "CSV (joint positions and rotations, a row a frame)", (".csv",), write=write)
