"""GLB (binary glTF 2.0) of a pose or a motion: a skinned capsule body, so that any viewer shows a person.

Nodes carry the skeleton's joint names; the animation holds one rotation track per joint and the root's translation. An
object mesh may stand beside the body.
"""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from roam_character.clip import Clip, clip_of
from roam_character.mesh import body_mesh, rest_origins
from roam_character.pose import Pose
from roam_character.skeleton import Skeleton

_FLOAT, _UINT, _USHORT = 5126, 5125, 5123
_TYPES = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}
_CODES = {"f": _FLOAT, "I": _UINT, "H": _USHORT}
_BODY_COLOUR = (0.86, 0.52, 0.32, 1.0)
_OBJECT_COLOUR = (0.62, 0.66, 0.72, 1.0)

Mesh = tuple[np.ndarray, np.ndarray]  # vertices [V, 3] [m], faces [F, 3]


class _Document:
    """A glTF document being built: JSON lists and one binary buffer."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0", "generator": "ROAM Services"}}
        self.buffer = bytearray()

    def add(self, kind: str, item: dict[str, Any]) -> int:
        """Appends to one of the document's lists and answers the index."""
        items = self.json.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def accessor(self, values: np.ndarray, code: str, *, target: int | None = None, bounds: bool = False) -> int:
        """Stores an array of little-endian `code` values and answers the accessor's index."""
        data = np.ascontiguousarray(values, "<" + {"f": "f4", "I": "u4", "H": "u2"}[code])
        view = {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": data.nbytes}
        if target:
            view["target"] = target
        self.buffer += data.tobytes() + bytes(-data.nbytes % 4)
        accessor: dict[str, Any] = {
            "bufferView": self.add("bufferViews", view),
            "componentType": _CODES[code],
            "count": len(data),
            "type": _TYPES[data.shape[1:]],
        }
        if bounds:
            flat = data.reshape(len(data), -1)
            accessor["min"], accessor["max"] = flat.min(axis=0).tolist(), flat.max(axis=0).tolist()
        return self.add("accessors", accessor)

    def material(self, name: str, colour: tuple[float, ...]) -> int:
        """Adds a plain two-sided material."""
        surface = {"baseColorFactor": list(colour), "metallicFactor": 0.0, "roughnessFactor": 0.8}
        return self.add("materials", {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True})

    def to_bytes(self) -> bytes:
        """The GLB container: header, JSON chunk, binary chunk."""
        self.json["buffers"] = [{"byteLength": len(self.buffer)}]
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        size = 12 + 8 + len(text) + 8 + len(self.buffer)
        head = struct.pack("<4sII", b"glTF", 2, size)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        return head + chunks + struct.pack("<I4s", len(self.buffer), b"BIN\0") + bytes(self.buffer)


def glb_bytes(content: Clip | Pose, *, mesh: Mesh | None = None) -> bytes:
    """The GLB file of a pose or motion, with an object mesh beside it if given (both in the same space)."""
    clip = clip_of([content], 30.0) if isinstance(content, Pose) else content
    document = _Document()
    root = _add_skeleton(document, clip)
    scene = [root, _add_body(document, clip.skeleton, root)]
    if mesh is not None:
        scene.append(_add_object(document, *mesh))
    if len(clip) > 1:
        _add_animation(document, clip, root)
    document.add("scenes", {"nodes": scene})
    document.json["scene"] = 0
    return document.to_bytes()


def write_glb(path: str | Path, content: Clip | Pose, *, mesh: Mesh | None = None) -> None:
    """Writes `glb_bytes` to a file."""
    Path(path).write_bytes(glb_bytes(content, mesh=mesh))


def _add_skeleton(document: _Document, clip: Clip) -> int:
    """One node per joint, posed as in the first frame; answers the root's index."""
    skeleton = clip.skeleton
    first = len(document.json.setdefault("nodes", []))
    for joint, name in enumerate(skeleton.joint_names):
        offset = clip.root_positions[0] if joint == 0 else skeleton.rest_offsets[joint]
        node: dict[str, Any] = {"name": name, "translation": np.asarray(offset, float).tolist()}
        node["rotation"] = np.asarray(clip.rotations[0, joint], float).tolist()
        children = [first + c for c, parent in enumerate(skeleton.parents) if parent == joint]
        if children:
            node["children"] = children
        document.add("nodes", node)
    return first


def _add_body(document: _Document, skeleton: Skeleton, root: int) -> int:
    body = body_mesh(skeleton)
    joints = np.zeros((len(body.vertices), 4))
    joints[:, 0] = body.joints
    weights = np.tile(np.array([1.0, 0, 0, 0]), (len(body.vertices), 1))
    attributes = {
        "POSITION": document.accessor(body.vertices, "f", target=34962, bounds=True),
        "NORMAL": document.accessor(body.normals, "f", target=34962),
        "JOINTS_0": document.accessor(joints, "H", target=34962),
        "WEIGHTS_0": document.accessor(weights, "f", target=34962),
    }
    indices = document.accessor(body.faces.reshape(-1), "I", target=34963)
    material = document.material("body", _BODY_COLOUR)
    primitive = {"attributes": attributes, "indices": indices, "material": material}
    mesh = document.add("meshes", {"name": "body", "primitives": [primitive]})
    inverse_bind = np.tile(np.eye(4), (skeleton.joint_count, 1, 1))
    inverse_bind[:, 3, :3] = -rest_origins(skeleton)  # column-major, as glTF stores matrices
    skin = {
        "joints": list(range(root, root + skeleton.joint_count)),
        "skeleton": root,
        "inverseBindMatrices": document.accessor(inverse_bind, "f"),
    }
    return document.add("nodes", {"name": "body", "mesh": mesh, "skin": document.add("skins", skin)})


def _add_object(document: _Document, vertices: np.ndarray, faces: np.ndarray) -> int:
    attributes = {"POSITION": document.accessor(vertices, "f", target=34962, bounds=True)}
    indices = document.accessor(np.asarray(faces).reshape(-1), "I", target=34963)
    primitive = {
        "attributes": attributes,
        "indices": indices,
        "material": document.material("object", _OBJECT_COLOUR),
    }
    return document.add(
        "nodes", {"name": "object", "mesh": document.add("meshes", {"name": "object", "primitives": [primitive]})}
    )


def _add_animation(document: _Document, clip: Clip, root: int) -> None:
    times = document.accessor(np.arange(len(clip)) / clip.frame_rate, "f", bounds=True)
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    tracks = [(root, "translation", clip.root_positions)]
    tracks += [(root + j, "rotation", clip.rotations[:, j]) for j in range(clip.skeleton.joint_count)]
    for node, path, values in tracks:
        samplers.append({"input": times, "output": document.accessor(values, "f"), "interpolation": "LINEAR"})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})
    document.add("animations", {"name": "motion", "samplers": samplers, "channels": channels})
