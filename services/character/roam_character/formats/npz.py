"""NPZ files of poses and motions: the plain arrays that other tools rely on.

Pose: `joint_names` [J], `parents` [J], `root_position` [3], `rotations` [J, 4] xyzw, `joint_positions` [J, 3].
Motion: the same with a leading T, plus `fps`, and where known `contacts` [T, 4], `action` [T] and
`goal_joint_positions` [J, 3]. Metres, +Y up; `object_to_world` [4, 4] stands beside where an object was involved.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from roam_character.clip import Clip
from roam_character.formats.registry import Format
from roam_character.formats.scene import Scene
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


def scene_arrays(scene: Scene) -> dict[str, Any]:
    """What .npz and .json hold of a scene: the arrays of its content, what its caller adds, the character's joints.

    With a character, `rig_joint_names` [N], `rig_parents` [N], `rig_translations` [T, N, 3] (the file's units),
    `rig_rotations` [T, N, 4] and `rig_scales` [N, 3] are the local transforms of the file's own nodes.
    """
    content = scene.content
    own = pose_arrays(content) if isinstance(content, Pose) else motion_arrays(content)
    arrays = {**own, **scene.arrays}
    if scene.character is not None:
        rig = scene.character.fit.rig
        arrays |= {
            "rig_joint_names": np.array(rig.joint_names),
            "rig_parents": np.array(rig.parents, np.int32),
            "rig_translations": scene.character.translations.astype(np.float32),
            "rig_rotations": scene.character.rotations.astype(np.float32),
            "rig_scales": scene.character.scales.astype(np.float32),
        }
    return arrays


def write(path: Path, scene: Scene) -> Sequence[str]:
    """Writes a scene's arrays; names and marks are one JSON text called `metadata`."""
    arrays = scene_arrays(scene)
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays, metadata=np.array(json.dumps(dict(scene.extra))))
    return ()


FORMAT = Format("npz", "NPZ (numpy arrays)", (".npz",), write=write)
