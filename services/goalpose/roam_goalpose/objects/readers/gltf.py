"""glTF 2.0 and GLB: the scene as it stands, without a library that guesses.

Section numbers are those of the Khronos glTF 2.0 specification. Read here: every primitive mode with faces, sparse and
quantised accessors, default morph weights, skins in the pose that the nodes hold, GPU instancing, Draco and meshopt.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Array, Geometry, Indices, Part, join
from roam_goalpose.objects.limits import Limits, check_counts
from roam_goalpose.objects.readers.gltf_accessors import DRACO, MESHOPT, Accessors, attribute

_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942
_MAX_NODES = 20_000
_MAX_JSON_DEPTH = 64
_TRIANGLES, _STRIP, _FAN = 4, 5, 6

INSTANCING = "EXT_mesh_gpu_instancing"
_VISIBILITY = "KHR_node_visibility"
# Extensions that are obeyed, or that change nothing but looks, data about the file, or what happens later.
_KNOWN = {DRACO, *MESHOPT, INSTANCING, _VISIBILITY, "KHR_mesh_quantization", "MSFT_lod", "MSFT_texture_dds"}
_HARMLESS = re.compile(
    r"(KHR|EXT|ADOBE|MSFT|MOZ|FB|NV|GRIFFEL|CESIUM|VENDOR)_(materials|texture|lights?|xmp|animation|audio|behavior|"
    r"interactivity|structural_metadata|mesh_features|instance_features|packing|environment|techniques|mesh_manifold|"
    r"node_hoverability|node_selectability|accessor_float|mesh_primitive_restart|image|property)\w*$|VRMC?_\w+$|VRM$"
)


def read_glb(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """A GLB file; raises ObjectError."""
    text, binary = _chunks(data)
    return _read(_parse(text, "glb"), binary, limits, companions, "glb")


def read_gltf(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """A `.gltf` whose buffers are embedded, or among `companions`; raises ObjectError."""
    return _read(_parse(data, "gltf"), None, limits, companions, "gltf")


def _read(
    document: dict[str, Any], binary: bytes | None, limits: Limits, companions: Mapping[str, bytes], format: str
) -> Geometry:
    try:
        _check_extensions(document)
        scene = _Scene(document, Accessors(document, binary, companions, limits), limits)
        return scene.read()
    except ObjectError as error:
        raise error
    except (TypeError, AttributeError, LookupError, ValueError, OverflowError, struct.error) as error:
        raise malformed(format, f"its JSON has the wrong structure ({_plain(error)})") from error


def _plain(error: Exception) -> str:
    """What an error of Python says about a document, without Python's words."""
    if isinstance(error, KeyError):
        return f"{error} is missing"
    if isinstance(error, IndexError):
        return "it refers to something that is not there"
    return "a value is of the wrong kind"


class _Scene:
    """The nodes of the scene that a document shows by default."""

    def __init__(self, document: Mapping[str, Any], accessors: Accessors, limits: Limits) -> None:
        self._document = document
        self._accessors = accessors
        self._limits = limits
        self._nodes: Sequence[Mapping[str, Any]] = document.get("nodes", ())
        self._meshes: Sequence[Mapping[str, Any]] = document.get("meshes", ())
        self._moved: dict[int, Array] = {}
        if len(self._nodes) > _MAX_NODES:
            raise malformed("gltf", f"it has {len(self._nodes)} nodes; at most {_MAX_NODES} are read")

    def read(self) -> Geometry:
        """All that is shown, as triangles in metres, +Y up."""
        shown = list(self._shown())
        self._check_size([(int(node["mesh"]), node) for _, node in shown])
        parts = [part for index, node in shown for part in self._placed(index, node)]
        if not shown and not self._nodes:  # meshes that no node shows: a bare library
            self._check_size([(index, {}) for index in range(len(self._meshes))])
            parts = [part for mesh in self._meshes for part in self._primitives(mesh, {})]
        geometry = join(parts)
        notes = geometry.notes
        for name in self._unread_extensions():
            geometry = geometry.noted(
                "OBJECT_PART_IGNORED", f"The file uses {name}, which is not read here: what it changes is not seen."
            )
        notes = geometry.notes
        return Geometry(geometry.vertices, geometry.faces, "y", 1.0, geometry.part, geometry.names, notes)

    def _shown(self) -> Iterator[tuple[int, Mapping[str, Any]]]:
        """Every node with a mesh below the scene's roots, with its index; also fills the nodes' world matrices."""
        self._place_all()
        scenes = self._document.get("scenes", ())
        children = {int(child) for node in self._nodes for child in node.get("children", ())}
        roots = (
            scenes[int(self._document.get("scene", 0))].get("nodes", ())
            if scenes
            else [index for index in range(len(self._nodes)) if index not in children]
        )
        waiting, seen = [int(root) for root in reversed(roots)], set[int]()
        while waiting:
            index = waiting.pop()
            if index in seen:
                raise malformed("gltf", f"its node {index} hangs from two others, or from itself")
            seen.add(index)
            node = self._nodes[_index(index)]
            if not node.get("extensions", {}).get(_VISIBILITY, {}).get("visible", True):
                continue
            if "mesh" in node:
                yield index, node
            waiting += [int(child) for child in reversed(node.get("children", ()))]

    def _place_all(self) -> None:
        """World matrices of all nodes, joints outside of the scene too (section 3.5.2)."""
        parents: dict[int, int] = {}
        for index, node in enumerate(self._nodes):
            for child in node.get("children", ()):
                if int(child) in parents:
                    raise malformed("gltf", f"its node {child} hangs from two others, or from itself")
                parents[_index(int(child))] = index
        for index in range(len(self._nodes)):
            chain = [index]
            while chain[-1] in parents and chain[-1] not in self._moved:
                chain.append(parents[chain[-1]])
                if len(chain) > len(self._nodes):
                    raise malformed("gltf", f"its node {index} hangs from itself")
            for one in reversed(chain):
                if one not in self._moved:
                    local = _local(self._nodes[one])
                    self._moved[one] = self._moved[parents[one]] @ local if one in parents else local

    def _check_size(self, shown: Sequence[tuple[int, Mapping[str, Any]]]) -> None:
        """Count what the scene unfolds to before anything is unpacked."""
        sizes = [self._mesh_size(mesh) for mesh in self._meshes]
        vertices = faces = 0
        for mesh, node in shown:
            copies = self._instance_count(node)
            vertices += copies * sizes[_index(mesh)][0]
            faces += copies * sizes[mesh][1]
        check_counts(vertices, faces, self._limits)

    def _mesh_size(self, mesh: Mapping[str, Any]) -> tuple[int, int]:
        vertices = faces = 0
        for primitive in mesh["primitives"]:
            if "POSITION" not in primitive["attributes"]:
                continue
            count = self._accessors.count(_index(int(primitive["attributes"]["POSITION"])))
            corners = self._accessors.count(_index(int(primitive["indices"]))) if "indices" in primitive else count
            vertices += count
            faces += corners // 3 if int(primitive.get("mode", _TRIANGLES)) == _TRIANGLES else corners
        return vertices, faces

    def _instance_count(self, node: Mapping[str, Any]) -> int:
        attributes = _instances_of(node)
        return max((self._accessors.count(_index(int(index))) for index in attributes.values()), default=1)

    def _placed(self, index: int, node: Mapping[str, Any]) -> Iterator[Part]:
        """The primitives of a node's mesh in the world, one part for each instance."""
        mesh = self._meshes[_index(int(node["mesh"]))]
        name = str(node.get("name") or mesh.get("name") or "")
        parts = list(self._primitives(mesh, node))
        if "skin" in node:  # the joints place it, not the node (section 3.7.3.3)
            yield _merged(name, parts)
            return
        for number, place in enumerate(self._places(index, node)):
            moved = [_moved(part, place) for part in parts]
            yield _merged(f"{name} {number + 1}" if _instances_of(node) else name, moved)

    def _places(self, index: int, node: Mapping[str, Any]) -> list[Array]:
        """World matrices of a node's mesh: one, or one for each instance (EXT_mesh_gpu_instancing)."""
        attributes = _instances_of(node)
        if not attributes:
            return [self._moved[index]]
        values = {name: self._accessors.floats(_index(int(at))) for name, at in attributes.items()}
        count = max(len(one) for one in values.values())
        nothing = {"TRANSLATION": np.zeros((count, 3)), "SCALE": np.ones((count, 3))}
        turn = values.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))
        step = values.get("TRANSLATION", nothing["TRANSLATION"])
        scale = values.get("SCALE", nothing["SCALE"])
        return [self._moved[index] @ _matrix(step[k], turn[k], scale[k]) for k in range(count)]

    def _primitives(self, mesh: Mapping[str, Any], node: Mapping[str, Any]) -> Iterator[Part]:
        """The primitives of a mesh in its own space (a skinned one in the world), morphed as the node says."""
        weights = node.get("weights", mesh.get("weights", ()))
        for primitive in mesh["primitives"]:
            mode = int(primitive.get("mode", _TRIANGLES))
            if "POSITION" not in primitive["attributes"] or mode in (1, 2, 3):
                continue  # lines have no surface
            yield self._primitive(primitive, mode, [float(weight) for weight in weights], node)

    def _primitive(
        self, primitive: Mapping[str, Any], mode: int, weights: Sequence[float], node: Mapping[str, Any]
    ) -> Part:
        attributes = primitive["attributes"]
        packed = primitive.get("extensions", {}).get(DRACO)
        mesh = self._accessors.draco(packed) if packed is not None else None
        if mesh is not None:
            vertices = np.asarray(mesh.points, np.float64).reshape(-1, 3)
            faces: Indices | None = np.asarray(getattr(mesh, "faces", np.zeros((0, 3))), np.int64).reshape(-1, 3)
            check_counts(len(vertices), len(faces) if faces is not None else 0, self._limits)
        else:
            vertices = self._accessors.floats(_index(int(attributes["POSITION"])))
            faces = self._faces(primitive, mode, len(vertices))
        vertices = self._morphed(vertices, primitive, weights)
        if "skin" in node and "JOINTS_0" in attributes:
            vertices = self._skinned(vertices, attributes, packed, mesh, int(node["skin"]))
        return Part("", vertices, faces)

    def _faces(self, primitive: Mapping[str, Any], mode: int, count: int) -> Indices | None:
        if mode == 0:
            return None
        indices = (
            self._accessors.integers(_index(int(primitive["indices"]))) if "indices" in primitive else np.arange(count)
        )
        if indices.ndim != 1:
            raise malformed("gltf", "its indices are no plain numbers")
        if mode == _TRIANGLES:
            return indices[: len(indices) // 3 * 3].reshape(-1, 3)
        if len(indices) < 3:
            return np.zeros((0, 3), np.int64)
        if mode == _STRIP:  # every other triangle is turned (section 3.7.2.1)
            strip = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
            strip[1::2] = strip[1::2, [1, 0, 2]]
            return strip
        if mode == _FAN:
            return np.stack([indices[1:-1], indices[2:], np.full(len(indices) - 2, indices[0])], axis=1)
        raise malformed("gltf", f"a primitive has the mode {mode}, which glTF does not have")

    def _morphed(self, vertices: Array, primitive: Mapping[str, Any], weights: Sequence[float]) -> Array:
        """Default morph weights applied (section 3.7.2.2)."""
        for weight, target in zip(weights, primitive.get("targets", ()), strict=False):
            if weight and "POSITION" in target:
                moves = self._accessors.floats(_index(int(target["POSITION"])))
                if moves.shape != vertices.shape:
                    raise malformed("gltf", "a morph target has another number of vertices than its mesh")
                vertices = vertices + weight * moves
        return vertices

    def _skinned(
        self, vertices: Array, attributes: Mapping[str, Any], packed: Mapping[str, Any] | None, mesh: Any, index: int
    ) -> Array:
        """Vertices in the world as the joints hold them."""
        skin = self._document["skins"][_index(index)]
        joints = [int(joint) for joint in skin["joints"]]
        matrices = np.stack([self._moved[joint] for joint in joints])
        if "inverseBindMatrices" in skin:
            bind = self._accessors.floats(_index(int(skin["inverseBindMatrices"])))[: len(joints)]
            matrices = matrices @ bind.reshape(-1, 4, 4).transpose(0, 2, 1)
        placed, total = np.zeros_like(vertices), np.zeros((len(vertices), 1))
        homogeneous = np.concatenate([vertices, np.ones((len(vertices), 1))], axis=1)
        for part in range(sum(name.startswith("JOINTS_") for name in attributes)):
            of = self._skin_attribute(attributes, packed, mesh, f"JOINTS_{part}").astype(np.int64)
            weight = self._skin_attribute(attributes, packed, mesh, f"WEIGHTS_{part}")
            if of.min(initial=0) < 0 or of.max(initial=0) >= len(joints):
                raise malformed("gltf", "a vertex hangs from a joint that its skin does not have")
            for k in range(of.shape[1]):
                placed += weight[:, k : k + 1] * np.einsum("vij,vj->vi", matrices[of[:, k]], homogeneous)[:, :3]
                total += weight[:, k : k + 1]
        return placed / np.where(total > 1e-9, total, 1.0)

    def _skin_attribute(
        self, attributes: Mapping[str, Any], packed: Mapping[str, Any] | None, mesh: Any, name: str
    ) -> Array:
        inside = (packed or {}).get("attributes", {})
        if mesh is not None and name in inside:
            values = attribute(mesh, int(inside[name]))
            if values is None:
                raise malformed("gltf", f"its Draco data have no {name}")
            return values
        return self._accessors.floats(_index(int(attributes[name])))

    def _unread_extensions(self) -> list[str]:
        """Extensions on nodes, meshes or primitives that nothing here knows: they may change the shape."""
        places = [*self._nodes, *self._meshes, *(p for mesh in self._meshes for p in mesh["primitives"])]
        found = {str(name) for place in places for name in place.get("extensions", ())}
        return sorted(name for name in found if not _is_known(name))


def _index(value: int) -> int:
    if value < 0:
        raise IndexError
    return value


def _instances_of(node: Mapping[str, Any]) -> Mapping[str, Any]:
    attributes: Mapping[str, Any] = node.get("extensions", {}).get(INSTANCING, {}).get("attributes", {})
    return {name: at for name, at in attributes.items() if name in ("TRANSLATION", "ROTATION", "SCALE")}


def _merged(name: str, parts: Sequence[Part]) -> Part:
    whole = join(parts)
    return Part(name, whole.vertices, whole.faces)


def _moved(part: Part, place: Array) -> Part:
    with np.errstate(all="ignore"):  # infinities are looked for afterwards
        vertices = part.vertices @ place[:3, :3].T + place[:3, 3]
        mirrored = bool(np.linalg.det(place[:3, :3]) < 0)
    # A mirrored instance turns its triangles inside out; turn them back.
    faces = part.faces[:, ::-1] if part.faces is not None and mirrored else part.faces
    return Part(part.name, vertices, faces)


def _local(node: Mapping[str, Any]) -> Array:
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    step, turn, scale = (
        np.array(node.get(key, default), np.float64)
        for key, default in (("translation", (0, 0, 0)), ("rotation", (0, 0, 0, 1)), ("scale", (1, 1, 1)))
    )
    return _matrix(step, turn, scale)


def _matrix(step: Array, turn: Array, scale: Array) -> Array:
    """Scale, then the turn (a quaternion xyzw of any length), then the step."""
    x, y, z, w = turn / max(float(np.linalg.norm(turn)), 1e-12)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * scale
    matrix[:3, 3] = step
    return matrix


def _is_known(extension: str) -> bool:
    return extension in _KNOWN or _HARMLESS.match(extension) is not None


def _check_extensions(document: Mapping[str, Any]) -> None:
    unknown = [str(name) for name in document.get("extensionsRequired", ()) if not _is_known(str(name))]
    if unknown:
        raise ObjectError(
            "OBJECT_FORMAT_UNSUPPORTED",
            field="content",
            message=f"The file requires the glTF extension {unknown[0][:60]!r}, which is not read here.",
            remedy="Export it without that extension (a plain GLB from Blender: File > Export > glTF 2.0).",
        )


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk (section 4.4)."""
    if len(data) < 20 or data[:4] != b"glTF":
        raise malformed("glb", "it does not begin with the 20-byte GLB header")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise malformed("glb", f"its version is {version}, only glTF 2.0 is read")
    if length > len(data):
        raise malformed("glb", f"it is cut off: the header promises {length} bytes, {len(data)} are there")
    size, kind = struct.unpack_from("<II", data, 12)
    if kind != _JSON_CHUNK or size > len(data) - 20:
        raise malformed("glb", "its first chunk is not a complete JSON chunk")
    text, at = data[20 : 20 + size], 20 + size
    if at + 8 > len(data):
        return text, None
    size, kind = struct.unpack_from("<II", data, at)
    if kind == _BINARY_CHUNK and size > len(data) - at - 8:
        raise malformed("glb", "it is cut off: its binary chunk is not complete")
    return text, data[at + 8 : at + 8 + size] if kind == _BINARY_CHUNK else None


def _parse(text: bytes, format: str) -> dict[str, Any]:
    if _depth(text) > _MAX_JSON_DEPTH:
        raise malformed(format, f"its JSON is nested more than {_MAX_JSON_DEPTH} levels deep")
    try:
        document = json.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise malformed(format, f"its JSON does not parse ({str(error)[:80]})") from error
    if not isinstance(document, dict):
        raise malformed(format, "its JSON is not an object")
    return document


def _depth(text: bytes) -> int:
    """The nesting depth of JSON that may not be JSON."""
    brackets = np.frombuffer(_STRING.sub(b"", text).translate(_STEPS, delete=_NOT_BRACKETS), dtype=np.int8)
    return int(np.cumsum(brackets, dtype=np.int64).max(initial=0))


# A string that does not end runs to the end: looking for its end from every quote would take quadratic time.
_STRING = re.compile(rb'"(?:[^"\\]|\\.)*+(?:"|\\?\Z)', re.DOTALL)
_NOT_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))
_STEPS = bytes.maketrans(b"[{]}", b"\x01\x01\xff\xff")
