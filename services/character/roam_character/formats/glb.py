"""GLB (binary glTF 2.0) of a pose or a motion: the user's character or the figure, the furniture beside it.

A motion's nodes hold the rest pose and one animation moves them (one rotation track for each joint and the root's
translation, LINEAR, signs without jumps); a still pose is in the nodes. The stand-in's joints end in leaf nodes at
head top, finger tips and toe tips, so that bones have the lengths they should.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from roam_character.clip import Clip
from roam_character.documents.gltf_document import GltfDocument
from roam_character.figure.person import figure_mesh
from roam_character.formats.character_glb import character_document
from roam_character.formats.figure_gltf import figure_primitives
from roam_character.formats.registry import Format
from roam_character.formats.scene import Furniture, Scene
from roam_character.mesh import corner_normals, rest_origins
from roam_character.pose import Pose
from roam_character.retargeting.onto_rig import continuous
from roam_character.skeleton import Skeleton

_OBJECT_COLOUR = (0.62, 0.66, 0.72, 1.0)

Mesh = tuple[np.ndarray, np.ndarray]  # vertices [V, 3] [m], faces [F, 3]


def scene_document(scene: Scene) -> GltfDocument:
    """The glTF document of a scene."""
    if scene.character is not None:
        document = character_document(scene.character, still=scene.is_pose, name=scene.name)
    else:
        document = body_document(scene.clip, still=scene.is_pose, name=scene.name)
    if scene.furniture is not None:
        _add_furniture(document, scene.furniture)
    document.mark_targets()
    return document


def write(path: Path, scene: Scene) -> Sequence[str]:
    """Writes a scene; the notes of the character's reader are what was lost."""
    path.write_bytes(scene_document(scene).to_bytes())
    return scene.character.fit.rig.notes if scene.character is not None else ()


FORMAT = Format("glb", "GLB (binary glTF 2.0)", (".glb",), write=write, furniture=True)


def glb_bytes(content: Clip | Pose, *, mesh: Mesh | None = None) -> bytes:
    """The GLB file of a pose or motion, with an object mesh beside it if given (both in the same space)."""
    furniture = None if mesh is None else Furniture(mesh_document(*mesh), np.eye(4))
    return scene_document(Scene(content, furniture=furniture)).to_bytes()


def write_glb(path: str | Path, content: Clip | Pose, *, mesh: Mesh | None = None) -> None:
    """Writes `glb_bytes` to a file."""
    Path(path).write_bytes(glb_bytes(content, mesh=mesh))


def mesh_document(vertices: np.ndarray, faces: np.ndarray | None, *, name: str = "object") -> GltfDocument:
    """Plain triangles with normals, or without faces a cloud of points, as a document [m]."""
    document = GltfDocument()
    material = document.material(name, _OBJECT_COLOUR)
    if faces is None or not len(faces):
        attributes = {"POSITION": document.accessor(vertices, target=34962, bounds=True)}
        primitive: dict[str, Any] = {"attributes": attributes, "mode": 0, "material": material}
    else:
        points, normals, corners = corner_normals(np.asarray(vertices, float), np.asarray(faces))
        attributes = {
            "POSITION": document.accessor(points, target=34962, bounds=True),
            "NORMAL": document.accessor(normals, target=34962),
        }
        indices = document.accessor(corners.reshape(-1), "I", target=34963)
        primitive = {"attributes": attributes, "indices": indices, "material": material}
    mesh = document.add("meshes", {"name": name, "primitives": [primitive]})
    document.scene_roots().append(document.add("nodes", {"name": name, "mesh": mesh}))
    return document


def _add_furniture(document: GltfDocument, furniture: Furniture) -> None:
    """The furniture's own nodes below one node that brings them to where the pose is."""
    roots = document.merge(furniture.document)
    node: dict[str, Any] = {"name": furniture.name, "children": roots}
    if not np.allclose(furniture.to_world, np.eye(4), atol=1e-9):
        node["matrix"] = np.asarray(furniture.to_world, float).T.reshape(-1).tolist()
    document.scene_roots().append(document.add("nodes", node))


def body_document(clip: Clip, *, still: bool, name: str = "motion") -> GltfDocument:
    """The figure on our skeleton, moving as the clip does."""
    document, skeleton = GltfDocument(), clip.skeleton
    _add_skeleton(document, clip, still=still)
    body = _add_body(document, skeleton)
    if not still:
        _add_animation(document, clip, name)
    document.add("scenes", {"nodes": [0, body]})
    document.json["scene"] = 0
    return document


def _add_skeleton(document: GltfDocument, clip: Clip, *, still: bool) -> None:
    """One node for each joint, in the rest pose or posed as in the first frame; then one for each tip."""
    skeleton, count = clip.skeleton, clip.skeleton.joint_count
    for joint, name in enumerate(skeleton.joint_names):
        offset = clip.root_positions[0] if still and joint == 0 else skeleton.rest_offsets[joint]
        turn = clip.rotations[0, joint] if still else skeleton.rest_rotations[joint]
        children = [c for c, parent in enumerate(skeleton.parents) if parent == joint]
        children += [count + i for i, tip in enumerate(skeleton.tips) if tip.parent == joint]
        node = {"name": name, "translation": np.asarray(offset, float).tolist(), "rotation": _unit(turn).tolist()}
        document.add("nodes", {**node, **({"children": children} if children else {})})
    for tip in skeleton.tips:
        document.add("nodes", {"name": tip.name, "translation": [float(v) for v in tip.offset]})


def _unit(turn: np.ndarray) -> np.ndarray:
    turn = np.asarray(turn, float)
    return np.asarray(turn / np.linalg.norm(turn, axis=-1, keepdims=True))


def _add_body(document: GltfDocument, skeleton: Skeleton) -> int:
    body = figure_mesh(skeleton)
    mesh = document.add("meshes", figure_primitives(document, body, body.joints))
    # Tips belong to the skin without moving anything: Blender then ends the last bones where they are.
    origins = rest_origins(skeleton)
    tips = [origins[tip.parent] + np.array(tip.offset) for tip in skeleton.tips]
    origins = np.concatenate([origins, np.array(tips).reshape(-1, 3)])
    inverse_bind = np.tile(np.eye(4), (len(origins), 1, 1))
    inverse_bind[:, 3, :3] = -origins  # column-major, as glTF stores matrices
    skin = {"joints": list(range(len(origins))), "inverseBindMatrices": document.accessor(inverse_bind)}
    return document.add("nodes", {"name": "body", "mesh": mesh, "skin": document.add("skins", skin)})


def _add_animation(document: GltfDocument, clip: Clip, name: str) -> None:
    times = document.accessor(np.arange(len(clip)) / clip.frame_rate, bounds=True)
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    turns = continuous(_unit(clip.rotations))
    tracks = [(0, "translation", clip.root_positions)]
    tracks += [(j, "rotation", turns[:, j]) for j in range(clip.skeleton.joint_count)]
    for node, path, values in tracks:
        samplers.append({"input": times, "output": document.accessor(values), "interpolation": "LINEAR"})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})
    document.add("animations", {"name": name, "samplers": samplers, "channels": channels})
