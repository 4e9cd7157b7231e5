"""PCD, the Point Cloud Library's format, version 0.7: ascii, binary and binary_compressed."""

from __future__ import annotations

import io
import struct
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Array, Geometry
from roam_goalpose.objects.limits import Limits, check_points

_NUMBER_KINDS: Mapping[str, str] = {"F": "f", "I": "i", "U": "u"}
_MAX_HEADER_BYTES = 16 * 1024
_MAX_FIELDS = 256


@dataclass(frozen=True)
class _Header:
    record: np.dtype[np.void]  # one point, fields in file order
    points: int
    encoding: str
    body: int  # [bytes] where the data begin


def read_pcd(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """Read x, y, z of every point; missing returns stay NaN, as PCD marks them; raises ObjectError."""
    header = _read_header(data)
    check_points(header.points, limits)
    if header.points * header.record.itemsize > limits.memory_bytes // 4:
        raise malformed("pcd", f"its points have {header.record.itemsize} bytes each, which is too much to unpack")
    body = data[header.body :]
    if header.encoding == "ascii":
        points = _ascii(body, header)
    elif header.encoding == "binary":
        points = _xyz(_records(body, header))
    else:
        points = _xyz(_compressed(body, header))
    return Geometry(points, None)


def _read_header(data: bytes) -> _Header:
    entries: dict[str, list[str]] = {}
    stream = io.BytesIO(data)
    while "DATA" not in entries:
        line = stream.readline(_MAX_HEADER_BYTES)
        if not line or stream.tell() > _MAX_HEADER_BYTES:
            raise malformed("pcd", "its header has no DATA line")
        words = line.decode("ascii", errors="replace").split()
        if words and not words[0].startswith("#"):
            entries[words[0].upper()] = words[1:]
    try:
        record = _record(entries)
        points = _count(entries)
        encoding = entries["DATA"][0].lower()
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise malformed("pcd", f"its header is not valid ({type(error).__name__}: {str(error)[:60]})") from error
    if encoding not in ("ascii", "binary", "binary_compressed"):
        raise malformed("pcd", f"DATA {encoding[:20]!r} is not ascii, binary or binary_compressed")
    if not {"x", "y", "z"} <= set(record.names or ()):
        raise malformed("pcd", "it has no fields x, y and z")
    if points < 0:
        raise malformed("pcd", "its number of points is negative")
    return _Header(record, points, encoding, stream.tell())


def _count(entries: Mapping[str, list[str]]) -> int:
    """POINTS may be left out: WIDTH x HEIGHT says the same, and more than one row is an organised cloud."""
    if "POINTS" in entries:
        return int(entries["POINTS"][0])
    return int(entries["WIDTH"][0]) * int(entries.get("HEIGHT", ["1"])[0])


def _record(entries: Mapping[str, list[str]]) -> np.dtype[np.void]:
    names = entries.get("FIELDS") or entries["COLUMNS"]
    counts = [int(count) for count in entries.get("COUNT", ["1"] * len(names))]
    if len(names) > _MAX_FIELDS or not all(0 < count <= 4096 for count in counts):
        raise ValueError("too many fields")
    fields = []
    for index, (name, size, kind, count) in enumerate(
        zip(names, entries["SIZE"], entries["TYPE"], counts, strict=True)
    ):
        # `_` is PCL's padding and may repeat; numpy wants unique names.
        unique = name if name in ("x", "y", "z") else f"{name}#{index}"
        number = np.dtype(f"<{_NUMBER_KINDS[kind.upper()]}{int(size)}")
        fields.append((unique, number) if count == 1 else (unique, number, (count,)))
    return np.dtype(fields)


def _ascii(body: bytes, header: _Header) -> Array:
    # A field with COUNT n takes n columns.
    columns: dict[str, int] = {}
    column = 0
    for name in header.record.names or ():
        columns[name] = column
        column += int(np.prod(header.record[name].shape, dtype=int))
    try:
        points = np.loadtxt(
            io.StringIO(body.decode("ascii", errors="replace")),
            usecols=[columns[axis] for axis in "xyz"],
            max_rows=header.points,
            ndmin=2,
        )
    except (ValueError, IndexError) as error:
        raise malformed("pcd", str(error)[:80]) from error
    _check_complete(len(points), header.points)
    return points.astype(np.float64)


def _records(body: bytes, header: _Header) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    _check_complete(len(body) // header.record.itemsize, header.points)
    return np.frombuffer(body, dtype=header.record, count=header.points)


def _compressed(body: bytes, header: _Header) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """LZF-compressed and field-major: all x, then all y, ...; rebuilt as records."""
    if len(body) < 8:
        raise malformed("pcd", "it is cut off before the compressed data")
    packed, unpacked = struct.unpack_from("<II", body)
    size = header.points * header.record.itemsize
    if unpacked != size or packed > len(body) - 8:
        raise malformed("pcd", "the sizes of its compressed data do not agree with its header")
    flat = lzf_decompress(body[8 : 8 + packed], unpacked)
    records = np.zeros(header.points, dtype=header.record)
    start = 0
    for name in header.record.names or ():
        part = header.record[name]
        stop = start + header.points * part.itemsize
        records[name] = np.frombuffer(flat[start:stop], dtype=part.base).reshape(records[name].shape)
        start = stop
    return records


def lzf_decompress(packed: bytes, size: int) -> bytes:
    """Unpack LibLZF data (literal runs and back references) into exactly `size` bytes."""
    out = bytearray()
    at, end = 0, len(packed)
    try:
        while at < end and len(out) <= size:
            control = packed[at]
            at += 1
            if control < 32:  # a run of control + 1 literal bytes
                out += packed[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += packed[at]
                at += 1
            distance = ((control & 31) << 8) + packed[at] + 1
            at += 1
            _copy_back(out, distance, length + 2)
    except IndexError as error:
        raise malformed("pcd", "its compressed data are damaged") from error
    if len(out) != size or at > end:
        raise malformed("pcd", "its compressed data are damaged")
    return bytes(out)


def _copy_back(out: bytearray, distance: int, length: int) -> None:
    start = len(out) - distance
    if start < 0:
        raise IndexError
    while length > 0:  # the source may overlap what is being written: copy in whole periods
        piece = out[start : start + length]
        out += piece
        length -= len(piece)


def _check_complete(found: int, promised: int) -> None:
    if found < promised:
        raise ObjectError(
            "OBJECT_MALFORMED",
            field="content",
            message=f"The PCD file is cut off: {promised} points are promised, {found} are there.",
            remedy="Send the whole file.",
        )


def _xyz(records: np.ndarray[tuple[int], np.dtype[np.void]]) -> Array:
    return np.stack([records[axis] for axis in "xyz"], axis=1).astype(np.float64)
