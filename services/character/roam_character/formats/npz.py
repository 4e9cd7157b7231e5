"""NPZ files of poses and motions: the plain arrays that other tools rely on.

Pose: `joint_names` [J], `parents` [J], `root_position` [3], `rotations` [J, 4] xyzw, `joint_positions` [J, 3].
Motion: the same with a leading T, plus `fps`, and where known `contacts` [T, 4], `action` [T] and
`goal_joint_positions` [J, 3]. Metres, +Y up; `object_to_world` [4, 4] stands beside where an object was involved.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from roam_character.clip import Clip
from roam_character.pose import Pose
from roam_character.skeleton import Skeleton


def pose_arrays(pose: Pose) -> dict[str, np.ndarray]:
    """The arrays of a pose file."""
    return {
        **_skeleton_arrays(pose.skeleton),
        "root_position": pose.root_position,
        "rotations": pose.rotations,
        "joint_positions": pose.positions(),
    }


def motion_arrays(clip: Clip) -> dict[str, np.ndarray]:
    """The arrays of a motion file, without those that only a session knows (contacts, action, goal)."""
    return {
        **_skeleton_arrays(clip.skeleton),
        "root_position": clip.root_positions,
        "rotations": clip.rotations,
        "joint_positions": clip.positions(),
        "fps": np.array(clip.frame_rate, np.float32),
    }


def _skeleton_arrays(skeleton: Skeleton) -> dict[str, np.ndarray]:
    return {"joint_names": np.array(skeleton.joint_names), "parents": np.array(skeleton.parents, np.int32)}


def write_npz(path: str | Path, content: Clip | Pose, **extra: np.ndarray) -> None:
    """Writes a pose or a motion; `extra` arrays (object_to_world, contacts, …) are stored beside."""
    arrays = pose_arrays(content) if isinstance(content, Pose) else motion_arrays(content)
    np.savez_compressed(Path(path), allow_pickle=False, **{**arrays, **extra})


def read_pose(path: str | Path, skeleton: Skeleton) -> Pose:
    """Reads a pose file. Raises ValueError when it is of another skeleton."""
    arrays = _read(path, skeleton)
    return Pose(skeleton, arrays["root_position"], arrays["rotations"])


def read_motion(path: str | Path, skeleton: Skeleton) -> Clip:
    """Reads a motion file. Raises ValueError when it is of another skeleton."""
    arrays = _read(path, skeleton)
    return Clip(skeleton, float(arrays["fps"]), arrays["root_position"], arrays["rotations"])


def _read(path: str | Path, skeleton: Skeleton) -> Mapping[str, np.ndarray]:
    with np.load(Path(path), allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    if tuple(arrays["joint_names"].tolist()) != skeleton.joint_names:
        raise ValueError(f"{Path(path).name} is of another skeleton: its joints are {arrays['joint_names'].tolist()}")
    return arrays
