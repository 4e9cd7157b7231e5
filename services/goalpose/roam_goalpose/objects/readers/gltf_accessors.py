"""The numbers behind a glTF's accessors: every component type, sparse, quantised, Draco and meshopt.

glTF 2.0 section 3.6; KHR_mesh_quantization, KHR_draco_mesh_compression, EXT_meshopt_compression and its successor
KHR_meshopt_compression.
"""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
import numpy.typing as npt

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Array, Indices
from roam_goalpose.objects.limits import Limits

# component type -> numpy type and the integer that stands for 1.0 (glTF 2.0, section 3.11)
_COMPONENTS: Mapping[int, tuple[str, float]] = {
    5120: ("<i1", 127.0),
    5121: ("<u1", 255.0),
    5122: ("<i2", 32767.0),
    5123: ("<u2", 65535.0),
    5125: ("<u4", 4294967295.0),
    5126: ("<f4", 1.0),
}
_WIDTHS: Mapping[str, int] = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
DRACO = "KHR_draco_mesh_compression"


class Accessors:
    """What a document's accessors hold.

    Args:
        document: the parsed JSON.
        binary: the GLB's second chunk, None in a `.gltf`.
        companions: files beside a `.gltf`, by the path that it names them with.
        limits: bounds on what is unpacked.
    """

    def __init__(
        self, document: Mapping[str, Any], binary: bytes | None, companions: Mapping[str, bytes], limits: Limits
    ) -> None:
        self._document = document
        self._binary = binary
        self._companions = companions
        self._most_bytes = limits.memory_bytes // 4
        self._buffers: dict[int, bytes] = {}
        self._views: dict[int, memoryview] = {}
        self._draco: dict[int, Any] = {}

    def count(self, index: int) -> int:
        """How many elements an accessor promises."""
        return int(self._document["accessors"][index]["count"])

    def floats(self, index: int) -> Array:
        """`[N, components]`, integers divided by what stands for one where they are normalised."""
        accessor = self._document["accessors"][index]
        values = self._raw(accessor)
        one = _COMPONENTS[int(accessor["componentType"])][1]
        floats = values.astype(np.float64)
        return np.maximum(floats / one, -1.0) if accessor.get("normalized") and one != 1.0 else floats

    def integers(self, index: int) -> Indices:
        """`[N]` of a scalar accessor, `[N, components]` of another."""
        values = self._raw(self._document["accessors"][index]).astype(np.int64)
        return values[:, 0] if values.shape[1] == 1 else values

    def draco(self, extension: Mapping[str, Any]) -> Any:
        """The decoded mesh of a primitive's Draco extension: `points`, `faces`, attributes."""
        view = int(extension["bufferView"])
        if view not in self._draco:
            self._draco[view] = _decode_draco(bytes(self._view(view)))
        return self._draco[view]

    def _raw(self, accessor: Mapping[str, Any]) -> npt.NDArray[Any]:
        """`[N, components]` in the accessor's own type, sparse values put in."""
        kind, _ = _COMPONENTS[int(accessor["componentType"])]
        width, count = _WIDTHS[accessor["type"]], int(accessor["count"])
        if count < 0 or count * width * 8 > self._most_bytes:
            raise malformed("gltf", f"an accessor promises {count} elements, more than are read")
        if "bufferView" in accessor:
            values = self._strided(int(accessor["bufferView"]), int(accessor.get("byteOffset", 0)), kind, width, count)
        else:
            self._check_promise(count)
            values = np.zeros((count, width), kind)  # section 3.6.2.3
        if "sparse" not in accessor:
            return values
        sparse, values = accessor["sparse"], values.copy()
        changed = int(sparse["count"])
        where, what = sparse["indices"], sparse["values"]
        index_kind = _COMPONENTS[int(where["componentType"])][0]
        rows = self._strided(int(where["bufferView"]), int(where.get("byteOffset", 0)), index_kind, 1, changed)[:, 0]
        values[rows] = self._strided(int(what["bufferView"]), int(what.get("byteOffset", 0)), kind, width, changed)
        return values

    def _check_promise(self, count: int) -> None:
        """An accessor without a buffer view is all zeros by the specification: a billion cost the sender nothing."""
        available = sum(int(view.get("byteLength", 0)) for view in self._document.get("bufferViews", ()))
        if count > max(available, 1):
            raise malformed("gltf", f"an accessor promises {count} elements, more than there are bytes")

    def _strided(self, view_index: int, offset: int, kind: str, width: int, count: int) -> npt.NDArray[Any]:
        view = self._document["bufferViews"][view_index]
        size = np.dtype(kind).itemsize
        extension = _meshopt_of(view)
        stride = int((extension or view).get("byteStride", 0)) or size * width
        data = self._view(view_index)
        if count == 0:
            return np.zeros((0, width), kind)
        if offset < 0 or stride < size * width or offset + stride * (count - 1) + size * width > len(data):
            raise malformed("gltf", f"an accessor of {count} elements reaches beyond its data")
        return np.ndarray((count, width), dtype=kind, buffer=data, offset=offset, strides=(stride, size))

    def _view(self, index: int) -> memoryview:
        if index in self._views:
            return self._views[index]
        view = self._document["bufferViews"][index]
        extension = _meshopt_of(view)
        source = extension or view
        data = self._buffer(int(source["buffer"]))
        start, length = int(source.get("byteOffset", 0)), int(source["byteLength"])
        if start < 0 or length < 0 or start + length > len(data):
            raise malformed("gltf", f"its buffer view {index} reaches beyond its buffer of {len(data)} bytes")
        part = memoryview(data)[start : start + length]
        if extension is not None:
            part = memoryview(_decode_meshopt(bytes(part), extension, self._most_bytes))
        self._views[index] = part
        return part

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            self._buffers[index] = self._load_buffer(index)
        return self._buffers[index]

    def _load_buffer(self, index: int) -> bytes:
        buffer = self._document["buffers"][index]
        uri = buffer.get("uri")
        if uri is None:
            if index or self._binary is None:
                raise malformed("gltf", f"its buffer {index} has no data")
            return self._binary
        if str(uri)[:5].lower() == "data:":
            return _data_uri(str(uri))
        return find_companion(str(uri), self._companions)


def find_companion(uri: str, companions: Mapping[str, bytes]) -> bytes:
    """The file of that name that came along in the same ZIP; raises OBJECT_EXTERNAL_FILE."""
    name = unquote(uri).replace("\\", "/")
    plain = name.removeprefix("./")
    if plain in companions:
        return companions[plain]
    last = plain.rsplit("/", 1)[-1].lower()
    same = [data for path, data in companions.items() if path.rsplit("/", 1)[-1].lower() == last]
    if len(same) == 1 and ":" not in plain:
        return same[0]
    raise ObjectError(
        "OBJECT_EXTERNAL_FILE",
        field="content",
        message=f"The glTF refers to another file, {uri[:80]!r}, which did not come with it.",
        remedy="Send both in one ZIP, or export one GLB file (Blender: glTF Binary).",
    )


def _data_uri(uri: str) -> bytes:
    head, _, body = uri.partition(",")
    if not head.lower().endswith(";base64"):
        return unquote_to_bytes(body)
    try:
        return base64.b64decode(unquote(body) + "==")
    except (binascii.Error, ValueError) as error:
        raise malformed("gltf", "an embedded buffer is not valid base64") from error


def _meshopt_of(view: Mapping[str, Any]) -> Mapping[str, Any] | None:
    extensions: Mapping[str, Any] = view.get("extensions", {})
    return next((extensions[name] for name in MESHOPT if name in extensions), None)


def _decode_meshopt(data: bytes, extension: Mapping[str, Any], most_bytes: int) -> bytes:
    """The bytes of a compressed buffer view."""
    import meshoptimizer

    count, stride, mode = int(extension["count"]), int(extension["byteStride"]), extension["mode"]
    if count < 0 or stride <= 0 or stride > 256 or count * stride > most_bytes:
        raise malformed("gltf", f"a meshopt view of {count} elements of {stride} bytes is more than is unpacked")
    if count == 0:
        return b""
    try:
        if mode == "ATTRIBUTES":
            if stride % 4:
                raise ValueError("the stride is no multiple of four")
            flat = meshoptimizer.decode_vertex_buffer(count, stride, data, dtype=np.dtype(f"V{stride}"))
            return _unfilter(flat, count, stride, str(extension.get("filter", "NONE")))
        if stride not in (2, 4) or mode not in ("TRIANGLES", "INDICES"):
            raise ValueError(f"mode {str(mode)[:20]!r} with a stride of {stride}")
        if mode == "TRIANGLES" and count % 3:
            raise ValueError("the indices are no whole triangles")
        decode = meshoptimizer.decode_index_buffer if mode == "TRIANGLES" else meshoptimizer.decode_index_sequence
        # The wheel returns pairs of 16-bit indices packed into one number when it is asked for 2 bytes.
        indices = np.asarray(decode(count, 4, data))
        return indices.astype("<u2" if stride == 2 else "<u4").tobytes()
    except (RuntimeError, ValueError) as error:
        raise malformed("gltf", f"its meshopt data cannot be unpacked ({str(error)[:60]})") from error


def _unfilter(flat: npt.NDArray[Any], count: int, stride: int, name: str) -> bytes:
    """Undo the filter of EXT_meshopt_compression that makes numbers easier to compress."""
    import meshoptimizer

    raw = np.frombuffer(flat.tobytes(), np.uint8).copy()
    if name == "NONE":
        return raw.tobytes()
    fits = {"OCTAHEDRAL": stride in (4, 8), "QUATERNION": stride == 8, "EXPONENTIAL": True}
    if not fits.get(name, False):
        raise ValueError(f"filter {name[:20]!r} with a stride of {stride}")
    if name == "EXPONENTIAL":  # 24 bits of mantissa, 8 of exponent
        words = raw.view("<i4")
        return np.ldexp((words << 8 >> 8).astype(np.float64), words >> 24).astype("<f4").tobytes()
    undo = meshoptimizer.decode_filter_oct if name == "OCTAHEDRAL" else meshoptimizer.decode_filter_quat
    return np.ascontiguousarray(undo(raw, count, stride)).view(np.uint8).tobytes()


def _decode_draco(data: bytes) -> Any:
    import DracoPy

    if data[:5] != b"DRACO":
        raise malformed("gltf", "its Draco data do not begin as Draco does")
    try:
        return DracoPy.decode(data)
    except Exception as error:  # the binding has several kinds
        raise malformed("gltf", "its Draco data cannot be unpacked") from error


def attribute(mesh: Any, unique_id: int) -> Array | None:
    """The values `[N, components]` of a decoded Draco mesh's attribute; None when it has no such one."""
    found: Sequence[Mapping[str, Any]] = mesh.attributes
    return next((np.asarray(one["data"], np.float64) for one in found if one["unique_id"] == unique_id), None)
