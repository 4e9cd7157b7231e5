"""A glTF 2.0 document in memory: JSON and one binary buffer, read, edited, merged and written as GLB.

Everything that a file holds and that is not touched (extensions, extras, compressed meshes, images) stays as it was.
"""

import base64
import json
import struct
import urllib.parse
from pathlib import Path
from typing import Any

import numpy as np

from roam_character.rotation import quat_from_matrix, quat_to_matrix

_DTYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_CODES = {"f": 5126, "I": 5125, "H": 5123, "B": 5121}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_TYPES = {(): "SCALAR", (2,): "VEC2", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}
GENERATOR = "ROAM Services"


class GltfError(ValueError):
    """The bytes are no glTF 2.0 that can be read; the message says why."""


class GltfDocument:
    """JSON lists and one binary buffer."""

    def __init__(self, content: dict[str, Any] | None = None, buffer: bytes = b"") -> None:
        self.json: dict[str, Any] = content or {"asset": {"version": "2.0", "generator": GENERATOR}}
        self.buffer = bytearray(buffer)

    @classmethod
    def read(cls, data: bytes, *, folder: Path | None = None) -> "GltfDocument":
        """From GLB or glTF text; buffers beside a .gltf are looked for in `folder`. Raises GltfError."""
        try:
            content, chunk = _chunks(data)
            if str(content.get("asset", {}).get("version", "")).split(".")[0] != "2":
                raise GltfError("it is not glTF 2.0")
            document = cls(content, b"")
            document._gather(chunk, folder)
        except (ValueError, KeyError, IndexError, TypeError, AttributeError, struct.error) as error:
            raise GltfError(f"not a readable glTF file: {error}") from error
        return document

    def _gather(self, chunk: bytes, folder: Path | None) -> None:
        """All buffers one behind the other."""
        starts = []
        for index, item in enumerate(self.json.get("buffers", [])):
            starts.append(len(self.buffer))
            piece = _buffer_bytes(item, chunk if index == 0 else b"", folder)
            if len(piece) < item["byteLength"]:
                raise GltfError(f"buffer {index} has {len(piece)} bytes and should have {item['byteLength']}")
            self.buffer += piece[: item["byteLength"]]
            self.buffer += bytes(-len(self.buffer) % 4)
        for view in self.json.get("bufferViews", []):
            view["byteOffset"] = view.get("byteOffset", 0) + starts[view["buffer"]]
            view["buffer"] = 0
            packed = view.get("extensions", {}).get("EXT_meshopt_compression")
            if packed is not None:
                packed["byteOffset"] = packed.get("byteOffset", 0) + starts[packed["buffer"]]
                packed["buffer"] = 0

    def add(self, kind: str, item: dict[str, Any]) -> int:
        """Appends to one of the document's lists and answers the index."""
        items = self.json.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def view(self, data: bytes, **extra: Any) -> int:
        """Stores bytes, aligned to 4, and answers the bufferView's index."""
        self.buffer += bytes(-len(self.buffer) % 4)
        item = {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": len(data), **extra}
        self.buffer += data
        return self.add("bufferViews", item)

    def accessor(self, values: np.ndarray, code: str = "f", *, target: int | None = None, bounds: bool = False) -> int:
        """Stores an array of little-endian `code` values (f, I, H, B) and answers the accessor's index."""
        data = np.ascontiguousarray(values, np.dtype(_DTYPES[_CODES[code]]))
        accessor: dict[str, Any] = {
            "bufferView": self.view(data.tobytes(), **({"target": target} if target else {})),
            "componentType": _CODES[code],
            "count": len(data),
            "type": _TYPES[data.shape[1:]],
        }
        if bounds:
            flat = data.reshape(len(data), -1)
            accessor["min"], accessor["max"] = flat.min(axis=0).tolist(), flat.max(axis=0).tolist()
        return self.add("accessors", accessor)

    def values(self, index: int) -> np.ndarray:
        """An accessor's values as float64 or integers [count, width]; normalised integers as numbers to 1.

        Raises GltfError for compressed data, which only stays in the file.
        """
        item = self.json["accessors"][index]
        width, dtype = _WIDTHS[item["type"]], np.dtype(_DTYPES[item["componentType"]])
        found = np.zeros((item["count"], width), dtype)
        if "bufferView" in item:
            found = self._strided(item["bufferView"], item.get("byteOffset", 0), item["count"], width, dtype)
        if "sparse" in item:
            found = found.copy()
            sparse = item["sparse"]
            where, what = sparse["indices"], sparse["values"]
            kind = np.dtype(_DTYPES[where["componentType"]])
            rows = self._strided(where["bufferView"], where.get("byteOffset", 0), sparse["count"], 1, kind)[:, 0]
            found[rows] = self._strided(what["bufferView"], what.get("byteOffset", 0), sparse["count"], width, dtype)
        if item.get("normalized"):
            return np.maximum(found / float(np.iinfo(dtype).max), -1.0)
        return found.astype(float) if dtype.kind == "f" else found

    def _strided(self, view: int, offset: int, count: int, width: int, dtype: np.dtype) -> np.ndarray:
        item = self.json["bufferViews"][view]
        if "EXT_meshopt_compression" in item.get("extensions", {}):
            raise GltfError("its data is compressed with EXT_meshopt_compression")
        start = item.get("byteOffset", 0) + offset
        stride = item.get("byteStride", 0) or width * dtype.itemsize
        if start + (count - 1) * stride + width * dtype.itemsize > len(self.buffer):
            raise GltfError("an accessor reaches beyond its buffer")
        return np.ndarray((count, width), dtype, bytes(self.buffer), start, (stride, dtype.itemsize)).copy()

    def material(self, name: str, colour: tuple[float, ...], **more: Any) -> int:
        """Adds a plain two-sided material."""
        surface = {"baseColorFactor": [float(c) for c in colour], "metallicFactor": 0.0, "roughnessFactor": 0.8}
        return self.add(
            "materials", {"name": name, "pbrMetallicRoughness": {**surface, **more}, "doubleSided": len(more) == 0}
        )

    def node_parents(self) -> list[int]:
        """Parent of every node, -1 for roots. Raises GltfError when the nodes are no forest."""
        nodes = self.json.get("nodes", [])
        parents = [-1] * len(nodes)
        for index, node in enumerate(nodes):
            for child in node.get("children", []):
                if parents[child] != -1 or child == index:
                    raise GltfError(f"node {child} has two parents")
                parents[child] = index
        for start in range(len(nodes)):
            steps, node = 0, start
            while node != -1:
                node, steps = parents[node], steps + 1
                if steps > len(nodes):
                    raise GltfError("the nodes form a circle")
        return parents

    def node_worlds(self) -> np.ndarray:
        """World matrices of all nodes as the file stores them [N, 4, 4]."""
        parents, nodes = self.node_parents(), self.json.get("nodes", [])
        worlds = np.zeros((len(nodes), 4, 4))
        for index in parents_first(parents):
            local = node_matrix(nodes[index])
            worlds[index] = local if parents[index] < 0 else worlds[parents[index]] @ local
        return worlds

    def scene_roots(self) -> list[int]:
        """The root nodes of the scene that is shown; a list that may be changed."""
        scenes = self.json.setdefault("scenes", [])
        if not scenes:
            scenes.append({"nodes": [i for i, p in enumerate(self.node_parents()) if p < 0]})
        self.json.setdefault("scene", 0)
        roots: list[int] = scenes[self.json["scene"]].setdefault("nodes", [])
        return roots

    def to_bytes(self) -> bytes:
        """The GLB container: header, JSON chunk, binary chunk."""
        content = {**self.json, "buffers": [{"byteLength": len(self.buffer)}]}
        content["asset"] = {**content["asset"], "generator": GENERATOR}
        text = json.dumps(content, separators=(",", ":"), ensure_ascii=False).encode()
        text += b" " * (-len(text) % 4)
        body = bytes(self.buffer) + bytes(-len(self.buffer) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(body))
        return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body

    def mark_targets(self) -> None:
        """Says of buffer views with vertex data or indices which they are, where the file does not and it is clear."""
        used: dict[int, set[int]] = {}
        views = self.json.get("bufferViews", [])

        def note(accessor: int | None, target: int) -> None:
            view = None if accessor is None else self.json["accessors"][accessor].get("bufferView")
            if view is not None:
                used.setdefault(view, set()).add(target)

        for mesh in self.json.get("meshes", []):
            for primitive in mesh["primitives"]:
                note(primitive.get("indices"), 34963)
                for table in (primitive["attributes"], *primitive.get("targets", [])):
                    for accessor in table.values():
                        note(accessor, 34962)
        for skin in self.json.get("skins", []):
            note(skin.get("inverseBindMatrices"), 0)
        for animation in self.json.get("animations", []):
            for sampler in animation["samplers"]:
                note(sampler["input"], 0)
                note(sampler["output"], 0)
        for view, targets in used.items():
            if len(targets) == 1 and (target := next(iter(targets))) and "target" not in views[view]:
                views[view]["target"] = target

    def copy(self) -> "GltfDocument":
        """A document that can be changed without changing this one."""
        return GltfDocument(json.loads(json.dumps(self.json)), bytes(self.buffer))

    def merge(self, other: "GltfDocument") -> list[int]:
        """Takes over everything of another document but its scenes and animations; answers its scene's root nodes."""
        self.buffer += bytes(-len(self.buffer) % 4)
        shift = {kind: len(self.json.get(kind, [])) for kind in _LISTS}
        content = _shifted(other.copy().json, shift, len(self.buffer))
        roots = [index + shift["nodes"] for index in other.copy().scene_roots()]
        self.buffer += other.buffer
        for kind in _LISTS:
            if content.get(kind):
                self.json.setdefault(kind, []).extend(content[kind])
        for kind in ("extensionsUsed", "extensionsRequired"):
            names = [*self.json.get(kind, []), *(n for n in content.get(kind, []) if n not in _BY_DOCUMENT)]
            if names:
                self.json[kind] = list(dict.fromkeys(names))
        return roots


_LISTS: tuple[str, ...] = (
    "accessors", "bufferViews", "cameras", "images", "materials", "meshes", "nodes", "samplers", "skins", "textures",
)  # fmt: skip
# Extensions whose data stands at the top of the file: without it their marks on nodes and materials mean nothing.
_BY_DOCUMENT: tuple[str, ...] = (
    "KHR_lights_punctual", "KHR_materials_variants", "KHR_audio", "VRM", "VRMC_vrm", "VRMC_springBone",
    "VRMC_node_constraint", "KHR_xmp_json_ld", "EXT_lights_image_based",
)  # fmt: skip
_REFERENCES = {
    "POSITION": "accessors", "bufferView": "bufferViews", "mesh": "meshes", "skin": "skins", "camera": "cameras",
    "material": "materials", "source": "images", "sampler": "samplers", "indices": "accessors",
    "inverseBindMatrices": "accessors", "skeleton": "nodes",
}  # fmt: skip


def _shifted(content: dict[str, Any], shift: dict[str, int], bytes_before: int) -> dict[str, Any]:
    """A document's lists with every index moved behind those of another one."""
    for view in content.get("bufferViews", []):
        for place in (view, view.get("extensions", {}).get("EXT_meshopt_compression")):
            if place is not None:
                place["byteOffset"] = place.get("byteOffset", 0) + bytes_before
    for kind in _LISTS:
        for item in content.get(kind, []):
            _shift_item(item, shift, inside=kind)
    return content


def _shift_item(item: Any, shift: dict[str, int], *, inside: str) -> None:
    if isinstance(item, list):
        for part in item:
            _shift_item(part, shift, inside=inside)
        return
    if not isinstance(item, dict):
        return
    for key in [name for name in item.get("extensions", {}) if name in _BY_DOCUMENT]:
        del item["extensions"][key]
    for key, value in item.items():
        if key in ("extras", "name"):
            continue
        if key == "attributes" or (key == "targets" and isinstance(value, list)):
            for table in value if isinstance(value, list) else [value]:
                for name in table:
                    table[name] += shift["accessors"] if "KHR_draco" not in inside else 0
        elif key in ("joints", "children") and isinstance(value, list):
            item[key] = [v + shift["nodes"] for v in value]
        elif key == "index" and isinstance(value, int):
            item[key] = value + shift["textures"]  # a textureInfo, of the core or of any material extension
        elif isinstance(value, int) and not isinstance(value, bool) and key in _REFERENCES:
            item[key] = value + shift[_REFERENCES[key]]
        else:
            _shift_item(value, shift, inside=f"{inside}/{key}")


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    if data[:4] != b"glTF":
        return json.loads(data.decode("utf-8-sig")), b""
    version, size = struct.unpack_from("<II", data, 4)
    if version != 2 or size > len(data):
        raise GltfError("the GLB header does not fit: another version, or the file is cut off")
    content, chunk, at = None, b"", 12
    while at + 8 <= size:
        length, kind = struct.unpack_from("<I4s", data, at)
        piece = data[at + 8 : at + 8 + length]
        content = json.loads(piece) if kind == b"JSON" and content is None else content
        chunk = piece if kind == b"BIN\0" and not chunk else chunk
        at += 8 + length
    if not isinstance(content, dict):
        raise GltfError("the GLB has no JSON")
    return content, chunk


def _buffer_bytes(item: dict[str, Any], chunk: bytes, folder: Path | None) -> bytes:
    uri = item.get("uri")
    if uri is None:
        if not chunk and item.get("extensions", {}).get("EXT_meshopt_compression", {}).get("fallback"):
            return bytes(item["byteLength"])
        return chunk
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    name = urllib.parse.unquote(uri)
    if folder is None or Path(name).is_absolute() or ".." in Path(name).parts or not (folder / name).is_file():
        raise GltfError(f"its buffer {name!r} is missing: keep it beside the file, or save one .glb")
    return (folder / name).read_bytes()


def parents_first(parents: list[int]) -> list[int]:
    """An order of nodes in which every parent precedes its children."""
    order: list[int] = []
    done = [False] * len(parents)
    for start in range(len(parents)):
        chain, node = [], start
        while node != -1 and not done[node]:
            chain.append(node)
            node = parents[node]
        for item in reversed(chain):
            done[item] = True
            order.append(item)
    return order


def node_matrix(node: dict[str, Any]) -> np.ndarray:
    """The local matrix of a node [4, 4]."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    return compose(
        np.array(node.get("translation", (0, 0, 0)), float),
        np.array(node.get("rotation", (0, 0, 0, 1)), float),
        np.array(node.get("scale", (1, 1, 1)), float),
    )


def compose(translation: np.ndarray, rotation: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Matrices [..., 4, 4] of translations [..., 3], unit quaternions [..., 4] and scales [..., 3]."""
    matrix = np.zeros((*np.shape(translation)[:-1], 4, 4))
    matrix[..., :3, :3] = quat_to_matrix(rotation) * np.asarray(scale)[..., None, :]
    matrix[..., :3, 3] = translation
    matrix[..., 3, 3] = 1
    return matrix


def decompose(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Translations [..., 3], unit quaternions [..., 4] and scales [..., 3] of matrices [..., 4, 4].

    Shear is dropped; a mirrored matrix gets a negative scale along x.
    """
    turn = np.array(matrix[..., :3, :3], float)
    scale = np.linalg.norm(turn, axis=-2)
    scale[..., 0] *= np.where(np.linalg.det(turn) < 0, -1.0, 1.0)
    turn = turn / np.where(np.abs(scale) < 1e-12, 1.0, scale)[..., None, :]
    u, _, v = np.linalg.svd(turn)
    return np.array(matrix[..., :3, 3]), quat_from_matrix(u @ v), scale
