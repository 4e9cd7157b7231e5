"""What a glTF file promises, looked at before anything is built from it.

trimesh does the reading (`mesh_file`); this module refuses files that point outside themselves, need a decoder that is
not here, or multiply a small file into a huge scene.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.gltf_quantized import quantized_positions, with_float_positions
from roam_goalpose.objects.limits import Limits, check_counts

_JSON_CHUNK = 0x4E4F534A
# Extensions without which the positions cannot be decoded. Material and lighting extensions do not matter here.
_COMPRESSION = {
    "KHR_draco_mesh_compression": "Draco",
    "EXT_meshopt_compression": "meshopt",
    "KHR_meshopt_compression": "meshopt",
}
# trimesh recurses into the node tree; deeper trees than this are not furniture.
_MAX_NODES = 5_000
_MAX_JSON_DEPTH = 64


def check_gltf(data: bytes, format: str, limits: Limits) -> bytes:
    """`data` if trimesh can read it as it is, else an equal file that it can.

    Raises:
        ObjectError: the glTF (`gltf` or `glb`) is damaged, not self-contained, compressed or too big.
    """
    document = _parse(_json_chunk(data) if format == "glb" else data, format)
    try:
        _check_document(document, limits)
        quantized = quantized_positions(document)
        if not quantized:
            return data
        if format == "gltf":
            raise _unsupported("has quantized positions (KHR_mesh_quantization) in a .gltf; only GLB may have them")
        return with_float_positions(data, document, quantized)
    except (TypeError, AttributeError, LookupError, ValueError, OverflowError, struct.error) as error:
        if isinstance(error, ObjectError):
            raise
        raise malformed(format, f"its JSON has the wrong structure ({type(error).__name__})") from error


def _json_chunk(data: bytes) -> bytes:
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
    return data[20 : 20 + size]


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


def _check_document(document: Mapping[str, Any], limits: Limits) -> None:
    for extension in document.get("extensionsRequired", ()):
        if extension in _COMPRESSION:
            raise _unsupported(f"is compressed with {_COMPRESSION[extension]} ({extension})")
    # Images may point anywhere: they are never read.
    for buffer in document.get("buffers", ()):
        if "uri" in buffer and str(buffer["uri"])[:5].lower() != "data:":
            raise _external(str(buffer["uri"]))
    _check_accessors(document)
    _check_scene_size(document, limits)


def _check_accessors(document: Mapping[str, Any]) -> None:
    """An accessor without a buffer view is all zeros by the specification: a billion cost the sender nothing."""
    available = sum(int(view.get("byteLength", 0)) for view in document.get("bufferViews", ()))
    for accessor in document.get("accessors", ()):
        if int(accessor["count"]) > max(available, 1):
            raise malformed("gltf", f"an accessor promises {accessor['count']} elements, more than there are bytes")


def _check_scene_size(document: Mapping[str, Any], limits: Limits) -> None:
    """Count what the scene unfolds to: meshes times the nodes that show them."""
    nodes: Sequence[Mapping[str, Any]] = document.get("nodes", ())
    if len(nodes) > _MAX_NODES:
        raise malformed("gltf", f"it has {len(nodes)} nodes; at most {_MAX_NODES} are read")
    sizes = [_mesh_size(document, mesh) for mesh in document.get("meshes", ())]
    shown = [sizes[int(node["mesh"])] for node in nodes if "mesh" in node] or sizes
    check_counts(sum(size[0] for size in shown), sum(size[1] for size in shown), limits)


def _mesh_size(document: Mapping[str, Any], mesh: Mapping[str, Any]) -> tuple[int, int]:
    accessors = document.get("accessors", ())
    vertices = faces = 0
    for primitive in mesh["primitives"]:
        count = int(accessors[int(primitive["attributes"]["POSITION"])]["count"])
        corners = int(accessors[int(primitive["indices"])]["count"]) if "indices" in primitive else count
        vertices += count
        faces += corners // 3
    return vertices, faces


def _unsupported(what: str) -> ObjectError:
    return ObjectError(
        "OBJECT_FORMAT_UNSUPPORTED",
        field="content",
        message=f"The mesh {what}.",
        remedy="Export it as GLB without mesh compression (in Blender: Data > Compression off).",
    )


def _external(uri: str) -> ObjectError:
    return ObjectError(
        "OBJECT_EXTERNAL_FILE",
        field="content",
        message=f"The glTF refers to another file, {uri[:80]!r}, which is never opened.",
        remedy="Export it as one GLB file (Blender: glTF Binary), or embed the buffers as data URIs.",
    )
