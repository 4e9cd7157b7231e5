"""glTF positions stored as normalised integers (KHR_mesh_quantization), rewritten as floats.

Mesh optimisers write them; trimesh reads the integers without dividing, which makes a chair thirty kilometres tall.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

# component type -> numpy type and the integer that stands for 1.0 (glTF 2.0, section 3.11)
_INTEGERS: Mapping[int, tuple[str, float]] = {
    5120: ("<i1", 127.0),
    5121: ("<u1", 255.0),
    5122: ("<i2", 32767.0),
    5123: ("<u2", 65535.0),
}
_FLOAT = 5126


def quantized_positions(document: Mapping[str, Any]) -> list[int]:
    """Indices of the accessors that hold positions as normalised integers."""
    accessors = document.get("accessors", ())
    used = {
        int(primitive["attributes"]["POSITION"])
        for mesh in document.get("meshes", ())
        for primitive in mesh["primitives"]
    }
    return sorted(index for index in used if accessors[index].get("normalized") and "bufferView" in accessors[index])


def with_float_positions(data: bytes, document: dict[str, Any], accessors: list[int]) -> bytes:
    """A GLB like `data` in which the named accessors are floats; `document` is its JSON and is changed.

    Raises:
        ValueError, KeyError, IndexError, struct.error: the file is not consistent.
    """
    binary = bytearray(_binary_chunk(data))
    for index in accessors:
        accessor = document["accessors"][index]
        floats = _decode(binary, document["bufferViews"][accessor["bufferView"]], accessor).astype("<f4").tobytes()
        binary += b"\0" * (-len(binary) % 4)
        document["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(floats)})
        binary += floats
        accessor.update(bufferView=len(document["bufferViews"]) - 1, byteOffset=0, componentType=_FLOAT)
        for outdated in ("normalized", "min", "max", "sparse"):
            accessor.pop(outdated, None)
    document["buffers"][0]["byteLength"] = len(binary)
    return _pack(document, bytes(binary))


def _decode(binary: bytearray, view: Mapping[str, Any], accessor: Mapping[str, Any]) -> npt.NDArray[np.float64]:
    """Positions `[N, 3]` of one accessor."""
    name, one = _INTEGERS[accessor["componentType"]]
    size = np.dtype(name).itemsize
    stride = int(view.get("byteStride", 3 * size))
    start = int(view.get("byteOffset", 0)) + int(accessor.get("byteOffset", 0))
    count = int(accessor["count"])
    if stride < 3 * size or start < 0 or start + stride * (count - 1) + 3 * size > len(binary):
        raise ValueError("positions lie outside the buffer")
    integers = np.ndarray((count, 3), dtype=name, buffer=binary, offset=start, strides=(stride, size)).copy()
    positions: npt.NDArray[np.float64] = np.maximum(integers / one, -1.0)
    return positions


def _binary_chunk(data: bytes) -> bytes:
    start = 20 + struct.unpack_from("<I", data, 12)[0]
    size = struct.unpack_from("<I", data, start)[0]
    return data[start + 8 : start + 8 + size]


def _pack(document: Mapping[str, Any], binary: bytes) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
