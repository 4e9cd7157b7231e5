"""Files that the demo page shows and saves: the figure, and what was seen as GLB, VRMA, BVH or USD."""

import json
import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from roam_character.clip import Clip
    from roam_character.pose import Pose

FORMATS = ("glb", "vrma", "bvh", "usdz")
FRAME_RATE = 30.0  # [1/s] of the frames that the page receives
MOST_FRAMES = 9000


@cache
def figure_glb() -> bytes:
    """The figure in its rest pose, with joints named as those of the default skeleton."""
    from roam_character.formats.glb import glb_bytes
    from roam_character.pose import Pose
    from roam_character.skeleton import humanoid_skeleton

    skeleton = humanoid_skeleton()
    return glb_bytes(Pose(skeleton, skeleton.rest_offsets[0], skeleton.rest_rotations))


def saved(data: bytes, format: str, object_format: str, transform: str) -> bytes:
    """A file of what the page showed.

    `data`: uint32 T and W = 3 + 4 J, float32 [T, W] root position [m] and rotations (xyzw), then the furniture's file;
    `transform`: JSON [4][4], file coordinates to world. One frame is a still pose. ValueError says what is wrong.
    """
    from roam_character.formats.registry import ExportError, write
    from roam_character.formats.scene import Scene

    from roam_command.exports import furniture_from

    if format not in FORMATS:
        raise ValueError(f"{format!r} cannot be saved from the page: choose one of {', '.join(FORMATS)}")
    content, rest = _content(data)
    matrix = np.array(json.loads(transform), float)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError("transform is not a matrix of 4 x 4 numbers")
    furniture = furniture_from(rest, object_format, matrix) if format in ("glb", "usdz") and rest else None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"motion.{format}"
        try:
            write(path, Scene(content, furniture=furniture))
        except ExportError as error:
            raise ValueError(f"{error} {error.remedy}") from error
        return path.read_bytes()


def _content(data: bytes) -> "tuple[Clip | Pose, bytes]":
    """The frames, and the bytes behind them."""
    from roam_character.clip import Clip
    from roam_character.pose import Pose
    from roam_character.skeleton import humanoid_skeleton

    skeleton = humanoid_skeleton()
    count, width = (int(v) for v in np.frombuffer(data[:8], "<u4")) if len(data) >= 8 else (0, 0)
    end = 8 + 4 * count * width
    if not 0 < count <= MOST_FRAMES or width != 3 + 4 * skeleton.joint_count or end > len(data):
        raise ValueError(f"between 1 and {MOST_FRAMES} frames of {skeleton.joint_count} joints are needed")
    table = np.frombuffer(data[8:end], "<f4").reshape(count, width)
    if not np.isfinite(table).all():
        raise ValueError("a frame has numbers that are not finite")
    rotations = table[:, 3:].reshape(count, skeleton.joint_count, 4)
    lengths = np.linalg.norm(rotations, axis=-1, keepdims=True)
    if lengths.min() < 0.5:
        raise ValueError("a frame has a rotation that is no quaternion")
    rotations = (rotations / lengths).astype(np.float32)
    if count == 1:
        return Pose(skeleton, table[0, :3].copy(), rotations[0]), data[end:]
    return Clip(skeleton, FRAME_RATE, table[:, :3].copy(), rotations), data[end:]
