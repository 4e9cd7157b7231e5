"""Computes energy/angle_limits.json from motion capture: python -m roam_goalpose.training.angle_limits FOLDER_OF_BVH

Bounds of twist and swing per humanoid bone: the 0.2 and 99.8 percentiles over all frames, made symmetric between left
and right. Only these few percentiles are stored, no motion. The motion-capture data must be cited; see
weights/MODEL_CARD.md.
"""

import argparse
import json
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from roam_character.documents.bvh import read_bvh
from roam_character.retarget import retarget
from roam_character.skeleton import Skeleton, humanoid_skeleton

from roam_goalpose.energy.terms.angle_limit import LIMITS_FILE, bone_axis, swing_twist

PERCENTILES = (0.2, 99.8)
EVERY = 4  # frames; neighbours say the same
# A captured figure without toes or with rigid collars says nothing about these; bounds from anatomy [rad].
ANATOMY = {
    "Toes": ([-0.6, -0.05, -0.05], [0.9, 0.05, 0.05]),
    "Shoulder": ([-0.2, -0.4, -0.5], [0.2, 0.4, 0.5]),
    "Hand": ([-1.2, -0.6, -1.2], [1.2, 0.6, 1.2]),
}


def gather_angles(folder: Path, skeleton: Skeleton) -> npt.NDArray[np.float32]:
    """Twist and swing of every joint in every `EVERY`-th frame of all clips. -> [frames, J, 3] [rad]."""
    axes = torch.tensor([bone_axis(skeleton, j) for j in range(skeleton.joint_count)])
    parts = []
    for path in sorted(folder.glob("*.bvh")):
        rotations = retarget(read_bvh(path), skeleton).rotations[::EVERY]
        parts.append(swing_twist(torch.as_tensor(rotations), axes).numpy())
    if not parts:
        raise FileNotFoundError(f"no .bvh files in {folder}")
    return np.concatenate(parts)


def symmetric_bounds(
    skeleton: Skeleton, low: npt.NDArray[np.float32], high: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """The wider of each bound and its mirror image. Mirroring in x keeps angles about x and negates those about y and
    z."""
    partner = list(skeleton.mirror)
    flip = np.array([1.0, -1.0, -1.0], np.float32)
    mirrored_low = np.where(flip > 0, low[partner], -high[partner])
    mirrored_high = np.where(flip > 0, high[partner], -low[partner])
    return np.minimum(low, mirrored_low), np.maximum(high, mirrored_high)


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args(argv).folder
    skeleton = humanoid_skeleton()
    angles = gather_angles(folder, skeleton)
    low, high = (np.percentile(angles, p, axis=0).astype(np.float32) for p in PERCENTILES)
    low, high = symmetric_bounds(skeleton, low, high)
    bones = {}
    for j, bone in enumerate(skeleton.humanoid_bones):
        if bone == "hips":
            continue
        plain = bone.removeprefix("left").removeprefix("right")
        given = ANATOMY.get(plain)
        bounds = (given[0], given[1]) if given else (low[j].tolist(), high[j].tolist())
        bones[bone] = {"low": [round(x, 3) for x in bounds[0]], "high": [round(x, 3) for x in bounds[1]]}
    record = {"unit": "rad", "frames": len(angles), "percentiles": PERCENTILES, "bones": bones}
    LIMITS_FILE.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
