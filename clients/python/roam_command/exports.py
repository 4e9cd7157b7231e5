"""Files that only the services' exporters write: GLB with a skinned body, BVH. Imported only when asked for."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from roam_client import GoalPose, Motion, Object
from roam_client.files import whole_file
from roam_client.objects import format_of

from roam_command.installation import INSTALL
from roam_command.reports import UsageError

if TYPE_CHECKING:
    from roam_character.formats.glb import Mesh

POSE_ENDINGS = (".npz", ".json", ".glb")
MOTION_ENDINGS = (".npz", ".json", ".glb", ".bvh")


def write_pose(path: Path, goal: GoalPose, *, source: Path, object: Object) -> None:
    """Writes a goal pose; a .glb holds the body and the object."""
    if path.suffix.lower() != ".glb":
        goal.save(path)
        return
    glb, pose = _needed(path, "roam_character.formats.glb"), _needed(path, "roam_character.pose")
    skeleton = _skeleton(path, goal)
    content = pose.Pose(skeleton, goal.root_position, goal.rotations)
    with whole_file(path) as part:
        glb.write_glb(part, content, mesh=read_mesh(source, object))


def write_motion(path: Path, motion: Motion, *, source: Path, object: Object) -> None:
    """Writes a motion; a .glb holds the animated body and the object, a .bvh the bare skeleton."""
    ending = path.suffix.lower()
    if ending not in (".glb", ".bvh"):
        motion.save(path)
        return
    clip_module = _needed(path, "roam_character.clip")
    clip = clip_module.Clip(_skeleton(path, motion), motion.frame_rate, motion.root_positions, motion.rotations)
    with whole_file(path) as part:
        if ending == ".bvh":
            _needed(path, "roam_character.formats.bvh").write_bvh(part, clip)
        else:
            _needed(path, "roam_character.formats.glb").write_glb(part, clip, mesh=read_mesh(source, object))


def read_mesh(source: Path, object: Object) -> "Mesh | None":
    """The file's triangles in the world of `object`; None for a point cloud."""
    return world_mesh(source.read_bytes(), format_of(source), object)


def world_mesh(data: bytes, format: str, object: Object) -> "Mesh | None":
    """The triangles of an uploaded file, brought to the world as the server did; None for a point cloud."""
    from roam_goalpose.objects.limits import Limits
    from roam_goalpose.objects.reading import read_geometry

    geometry = read_geometry(data, format, Limits())
    if geometry.faces is None:
        return None
    turn, offset = object.object_to_world[:3, :3], object.object_to_world[:3, 3]
    return np.asarray(geometry.vertices @ turn.T + offset, np.float32), np.asarray(geometry.faces, np.int32)


def _skeleton(path: Path, content: GoalPose | Motion) -> Any:
    module, skeleton = _needed(path, "roam_character.skeleton"), content.skeleton
    tips = tuple(module.Tip(tip.name, tip.joint, tip.offset) for tip in skeleton.tips)
    return module.Skeleton(
        joint_names=skeleton.joint_names,
        parents=skeleton.parents,
        rest_offsets=skeleton.rest_offsets,
        rest_rotations=skeleton.rest_rotations,
        humanoid_bones=skeleton.humanoid_bones,
        tips=tips,
    )


def check_exporters(paths: list[Path]) -> None:
    """UsageError now rather than after the work, when a file needs exporters that are not installed."""
    for path in paths:
        if path.suffix.lower() in (".glb", ".bvh"):
            _needed(path, "roam_character.formats.glb")
            _needed(path, "roam_goalpose.objects.reading")


def _needed(path: Path, module: str) -> Any:
    import importlib

    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise UsageError(
            f"writing {path.name} needs the services' exporters, and {error.name} is not installed",
            remedy=f"Write .npz or .json, or {INSTALL}.",
        ) from error
