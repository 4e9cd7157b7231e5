"""Files of results: every format of `roam_character.formats`; .npz and .json without it too."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from roam_client import GoalPose, Motion, Object
from roam_client.types.objects import format_of

from roam_command.character import Character, own_skeleton
from roam_command.installation import INSTALL
from roam_command.reports import UsageError, stderr

if TYPE_CHECKING:
    from roam_character.formats.scene import Furniture, Scene

_BARE = (".npz", ".json")  # what the client writes by itself


def pose_endings() -> tuple[str, ...]:
    """Endings of files that a still pose can be saved as."""
    return _endings(poses=True)


def motion_endings() -> tuple[str, ...]:
    """Endings of files that a motion can be saved as."""
    return _endings(poses=False)


def _endings(*, poses: bool) -> tuple[str, ...]:
    try:
        from roam_character.formats.registry import endings
    except ModuleNotFoundError:
        return (*_BARE, ".glb", ".bvh")
    return endings(poses=poses)


def write_pose(path: Path, goal: GoalPose, *, source: Path, object: Object, character: Character | None = None) -> None:
    """Writes a goal pose; formats that hold furniture get the object beside the body."""
    if path.suffix.lower() in _BARE and character is None:
        goal.save(path)
        return
    _needed(path, "roam_character.formats.registry")
    from roam_character.formats.scene import Scene
    from roam_character.pose import Pose

    skeleton = own_skeleton(goal.skeleton) if character is None else character.fit.skeleton
    arrays, extra = goal.arrays(), {"name": goal.name, "object": goal.object, "reference_pose": goal.reference_pose}
    scene = Scene(
        Pose(skeleton, goal.root_position, goal.rotations),
        character=None if character is None else character.posed(goal),
        furniture=_furniture(path, source, object),
        arrays=arrays,
        extra=extra,
        name=goal.action.name.lower(),
    )
    _write(path, scene)


def write_motion(
    path: Path, motion: Motion, *, source: Path, object: Object, character: Character | None = None
) -> None:
    """Writes a motion; formats that hold furniture get the object beside the body."""
    if path.suffix.lower() in _BARE and character is None:
        motion.save(path)
        return
    _needed(path, "roam_character.formats.registry")
    from roam_character.clip import Clip
    from roam_character.formats.scene import Scene

    skeleton = own_skeleton(motion.skeleton) if character is None else character.fit.skeleton
    scene = Scene(
        Clip(skeleton, motion.frame_rate, motion.root_positions, motion.rotations),
        character=None if character is None else character.moved(motion),
        furniture=_furniture(path, source, object),
        arrays=motion.arrays(),
        extra={"goal_reached": motion.goal_reached},
        name=motion.goal.action.name.lower() if motion.goal is not None else "motion",
    )
    _write(path, scene)


def _write(path: Path, scene: "Scene") -> None:
    from roam_character.formats.registry import ExportError, write

    try:
        write(path, scene)
    except ExportError as error:
        raise UsageError(str(error), remedy=error.remedy) from error


def _furniture(path: Path, source: Path, object: Object) -> "Furniture | None":
    from roam_character.formats.registry import format_of as file_format

    return furniture_of(source, object) if file_format(path).furniture else None


def furniture_of(source: Path, object: Object) -> "Furniture":
    """The object as its file has it: materials, normals, texture coordinates and hierarchy of a glTF file are kept,
    other meshes get normals, clouds stay points."""
    return furniture_from(source.read_bytes(), format_of(source), object.object_to_world, folder=source.parent)


def furniture_from(data: bytes, format: str, to_world: np.ndarray, *, folder: Path | None = None) -> "Furniture":
    """The same from a file's bytes; `to_world` [4, 4]. Buffers beside a .gltf are looked for in `folder`."""
    from roam_character.documents.gltf_document import GltfDocument, GltfError
    from roam_character.formats.scene import Furniture

    if format in ("glb", "gltf"):
        try:
            document = GltfDocument.read(data, folder=folder)
            document.node_worlds()
        except GltfError:
            pass
        else:
            document.json.pop("animations", None)
            return Furniture(document, to_world)
    return Furniture(_plain(data, format), to_world)


def _plain(data: bytes, format: str) -> Any:
    from roam_character.formats.glb import mesh_document
    from roam_goalpose.objects.limits import Limits
    from roam_goalpose.objects.reading import read_geometry

    geometry = read_geometry(data, format, Limits())
    return mesh_document(np.asarray(geometry.vertices), None if geometry.faces is None else np.asarray(geometry.faces))


def check_exporters(paths: list[Path]) -> None:
    """UsageError now rather than after the work, when a file needs something that is not installed."""
    for path in paths:
        if path.suffix.lower() in _BARE:
            continue
        _needed(path, "roam_character.formats.registry")
        _needed(path, "roam_goalpose.objects.reading")
        from roam_character.formats.registry import format_of as file_format

        if lacking := file_format(path).missing():
            raise UsageError(
                f"writing {path.name} needs {lacking}, which is not installed", remedy="Install it, or write .glb."
            )


def tell_lost(paths: list[Path]) -> None:
    """Says what the formats of the written files cannot hold."""
    for path in paths:
        if path.suffix.lower() in (".bvh", ".vrma", ".csv"):
            stderr.print(f"{path.name} holds the skeleton only: no mesh, no furniture", style="dim", highlight=False)


def _needed(path: Path, module: str) -> Any:
    import importlib

    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise UsageError(
            f"writing {path.name} needs the services' exporters, and {error.name} is not installed",
            remedy=f"Write .npz or .json, or {INSTALL}.",
        ) from error
