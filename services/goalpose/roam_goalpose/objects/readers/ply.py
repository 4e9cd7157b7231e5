"""PLY (Stanford), text and binary: polygons of any and mixed size, triangle strips, points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Array, Geometry, Indices
from roam_goalpose.objects.limits import Limits, check_counts, check_points
from roam_goalpose.objects.readers.polygons import triangulate

_KINDS: Mapping[str, str] = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS: Mapping[str, str] = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER = 64 * 1024
_INDEX_NAMES = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    name: str
    kind: str  # numpy, without byte order
    count_kind: str = ""  # of a list's length; "" for a single number


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property]

    @property
    def lists(self) -> list[_Property]:
        return [one for one in self.properties if one.count_kind]


@dataclass(frozen=True, eq=False)
class _Lists:
    """A list property of all rows: `values` back to back, `sizes` `[rows]`."""

    values: Indices
    sizes: Indices


def read_ply(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """Vertices and faces; without any face the vertices are a cloud; raises ObjectError."""
    elements, order, start = _header(data)
    counts = {element.name: element.count for element in elements}
    if counts.get("face", 0) or counts.get("tristrips", 0):
        check_counts(counts.get("vertex", 0), counts.get("face", 0), limits)
    else:
        check_points(counts.get("vertex", 0), limits)
    for element in elements:
        if element.count > len(data):
            raise malformed("ply", f"it is cut off: {element.count} elements are promised, {len(data)} bytes are there")
    try:
        read = _Text(data[start:]) if not order else _Binary(data, start, order)
        columns = {element.name: read.element(element) for element in elements}
        return _geometry(columns, limits)
    except ObjectError:
        raise
    except (ValueError, KeyError, IndexError, OverflowError) as error:
        raise malformed("ply", "its data do not agree with its header") from error


def _header(data: bytes) -> tuple[list[_Element], str, int]:
    end = data.find(b"end_header", 0, _MAX_HEADER)
    if end < 0:
        raise malformed("ply", "its header does not end")
    start = end + len(b"end_header")
    start += 2 if data[start : start + 2] == b"\r\n" else 1
    elements: list[_Element] = []
    order = None
    try:
        for line in data[:end].decode("latin-1").replace("\r", "\n").split("\n"):
            words = line.split()
            if not words or words[0] in ("ply", "comment", "obj_info"):
                continue
            if words[0] == "format":
                order = _ORDERS[words[1]]
            elif words[0] == "element":
                elements.append(_Element(words[1], int(words[2]), []))
            elif words[0] == "property" and words[1] == "list":
                elements[-1].properties.append(_Property(words[4], _KINDS[words[3]], _KINDS[words[2]]))
            elif words[0] == "property":
                elements[-1].properties.append(_Property(words[2], _KINDS[words[1]]))
    except (KeyError, IndexError, ValueError) as error:
        raise malformed("ply", f"its header is not valid at {line[:40]!r}") from error
    if order is None or any(element.count < 0 for element in elements):
        raise malformed("ply", "its header names no format that PLY has")
    return elements, order, start


class _Binary:
    """Elements one after another from packed bytes."""

    def __init__(self, data: bytes, at: int, order: str) -> None:
        self._data, self._at, self._order = data, at, order

    def element(self, element: _Element) -> dict[str, Array | _Lists]:
        """Every property of every row."""
        if not element.lists:
            return self._columns(element, self._take(element, {}))
        first = self._row_sizes(element)
        records = self._record(element, first)
        if self._at + records.itemsize * element.count <= len(self._data):
            rows = np.frombuffer(self._data, records, element.count, self._at)
            if all((rows[f"#{one.name}"] == first[one.name]).all() for one in element.lists):
                self._at += records.itemsize * element.count
                return self._columns(element, rows)
        return self._one_by_one(element)

    def _take(self, element: _Element, sizes: Mapping[str, int]) -> npt.NDArray[np.void]:
        record = self._record(element, sizes)
        if self._at + record.itemsize * element.count > len(self._data):
            raise malformed("ply", f"it is cut off: {element.count} rows of {element.name!r} are promised")
        rows = np.frombuffer(self._data, record, element.count, self._at)
        self._at += record.itemsize * element.count
        return rows

    def _record(self, element: _Element, sizes: Mapping[str, int]) -> np.dtype[np.void]:
        fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
        for one in element.properties:
            if one.count_kind:
                fields += [(f"#{one.name}", self._order + one.count_kind)]
                fields += [(one.name, self._order + one.kind, (sizes[one.name],))]
            else:
                fields.append((one.name, self._order + one.kind))
        return np.dtype(fields)

    def _columns(self, element: _Element, rows: npt.NDArray[np.void]) -> dict[str, Array | _Lists]:
        found: dict[str, Array | _Lists] = {}
        for one in element.properties:
            values = rows[one.name]
            if one.count_kind:
                sizes = np.full(len(rows), values.shape[1], np.int64)
                found[one.name] = _Lists(values.astype(np.int64).ravel(), sizes)
            else:
                found[one.name] = values.astype(np.float64)
        return found

    def _row_sizes(self, element: _Element) -> dict[str, int]:
        """Lengths of the lists in the row at hand; empty elements have lists of none."""
        sizes: dict[str, int] = {}
        at = self._at
        for one in element.properties if element.count else ():
            if one.count_kind:
                sizes[one.name] = self._length(at, one)
                at += np.dtype(one.count_kind).itemsize + sizes[one.name] * np.dtype(one.kind).itemsize
            else:
                at += np.dtype(one.kind).itemsize
        return sizes or {one.name: 0 for one in element.lists}

    def _length(self, at: int, one: _Property) -> int:
        size = np.dtype(one.count_kind).itemsize
        if one.count_kind[0] == "f" or at + size > len(self._data):
            raise malformed("ply", f"it is cut off in a list {one.name!r}")
        order = "big" if self._order == ">" else "little"
        length = int.from_bytes(self._data[at : at + size], order, signed=one.count_kind[0] == "i")  # type: ignore[arg-type]
        if length < 0 or length > len(self._data):
            raise malformed("ply", f"a list {one.name!r} has {length} numbers")
        return length

    def _one_by_one(self, element: _Element) -> dict[str, Array | _Lists]:
        """Rows of different length: where each list begins, then all lists of one length at a time."""
        places: dict[str, list[int]] = {one.name: [] for one in element.lists}
        lengths: dict[str, list[int]] = {one.name: [] for one in element.lists}
        at = self._at
        widths = [
            (one, np.dtype(one.count_kind or one.kind).itemsize, np.dtype(one.kind).itemsize)
            for one in element.properties
        ]
        for _ in range(element.count):
            for one, width, item in widths:
                if one.count_kind:
                    length = (
                        self._data[at] if one.count_kind == "u1" and at < len(self._data) else self._length(at, one)
                    )
                    places[one.name].append(at + width)
                    lengths[one.name].append(length)
                    at += length * item
                at += width
        if at > len(self._data):
            raise malformed("ply", f"it is cut off: {element.count} rows of {element.name!r} are promised")
        self._at = at
        return {
            one.name: self._gathered(one, np.array(places[one.name], np.int64), np.array(lengths[one.name], np.int64))
            for one in element.lists
        }

    def _gathered(self, one: _Property, places: Indices, sizes: Indices) -> _Lists:
        raw = np.frombuffer(self._data, np.uint8)
        item = np.dtype(one.kind).itemsize
        values = np.zeros(int(sizes.sum()), np.int64)
        starts = np.cumsum(sizes) - sizes
        for size in np.unique(sizes[sizes > 0]):
            rows = np.flatnonzero(sizes == size)
            part = raw[places[rows, None] + np.arange(size * item)]
            values[starts[rows, None] + np.arange(size)] = part.view(self._order + one.kind).astype(np.int64)
        return _Lists(values, sizes)


class _Text:
    """Elements one after another from words."""

    def __init__(self, body: bytes) -> None:
        self._words = body.split()
        self._at = 0

    def element(self, element: _Element) -> dict[str, Array | _Lists]:
        """Every property of every row."""
        if not element.lists:
            width = len(element.properties)
            values = self._numbers(element.count * width).reshape(element.count, width)
            return {one.name: values[:, k] for k, one in enumerate(element.properties)}
        if len(element.properties) == 1 and (uniform := self._uniform(element)) is not None:
            return uniform
        found: dict[str, list[bytes]] = {one.name: [] for one in element.lists}
        sizes: dict[str, list[int]] = {one.name: [] for one in element.lists}
        for _ in range(element.count):
            for one in element.properties:
                if not one.count_kind:
                    self._at += 1
                    continue
                length = int(self._words[self._at])
                found[one.name] += self._words[self._at + 1 : self._at + 1 + length]
                sizes[one.name].append(length)
                self._at += 1 + length
        return {
            name: _Lists(np.array(words, "S24").astype(np.float64).astype(np.int64), np.array(sizes[name], np.int64))
            for name, words in found.items()
        }

    def _uniform(self, element: _Element) -> dict[str, Array | _Lists] | None:
        """One list a row, all of the same length."""
        if not element.count:
            return None
        length = int(self._words[self._at])
        total = element.count * (length + 1)
        if length < 0 or self._at + total > len(self._words):
            return None
        words = np.array(self._words[self._at : self._at + total], "S24").reshape(element.count, length + 1)
        if not (words[:, 0] == words[0, 0]).all():
            return None
        self._at += total
        sizes = np.full(element.count, length, np.int64)
        return {element.properties[0].name: _Lists(words[:, 1:].astype(np.float64).astype(np.int64).ravel(), sizes)}

    def _numbers(self, count: int) -> Array:
        words = self._words[self._at : self._at + count]
        if len(words) < count:
            raise malformed("ply", "it is cut off: numbers are missing")
        self._at += count
        return np.array(words, "S32").astype(np.float64)


def _geometry(columns: Mapping[str, Mapping[str, Array | _Lists]], limits: Limits) -> Geometry:
    vertex = columns["vertex"]
    vertices = np.stack([np.asarray(vertex[axis], np.float64) for axis in "xyz"], axis=1)
    faces: list[Indices] = []
    lists = next((columns["face"][name] for name in _INDEX_NAMES if name in columns.get("face", {})), None)
    if isinstance(lists, _Lists):
        check_counts(0, int(np.maximum(lists.sizes - 2, 0).sum()), limits)
        faces.append(triangulate(vertices, lists.values, lists.sizes))
    strips = next((columns["tristrips"][name] for name in _INDEX_NAMES if name in columns.get("tristrips", {})), None)
    if isinstance(strips, _Lists):
        check_counts(0, len(strips.values), limits)
        faces.append(_unwound(strips.values))
    triangles = np.concatenate(faces) if faces else np.zeros((0, 3), np.int64)
    return Geometry(vertices, triangles if len(triangles) else None)


def _unwound(strip: Indices) -> Indices:
    """The triangles of strips that -1 parts, as Stanford's range scans have them."""
    if len(strip) < 3:
        return np.zeros((0, 3), np.int64)
    begins = np.maximum.accumulate(np.where(strip < 0, np.arange(len(strip)) + 1, 0))
    triangles = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
    odd = (np.arange(len(triangles)) - begins[:-2]) % 2 == 1
    triangles[odd] = triangles[odd][:, [1, 0, 2]]
    return triangles[(triangles >= 0).all(axis=1)]
