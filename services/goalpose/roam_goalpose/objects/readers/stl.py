"""STL, binary and text, as programs really write it."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from roam_goalpose.objects.errors import malformed, not_finite
from roam_goalpose.objects.geometry import Geometry
from roam_goalpose.objects.limits import Limits, check_counts

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"(?i)\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")
_LOOP = re.compile(rb"(?i)\bouter\s*loop\b")


def read_stl(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """A soup of triangles; raises ObjectError.

    Whether it is text is told by its words, not by its first one: binary files begin with `solid` too, and text files
    with `Solid` or `SOLID`.
    """
    promised = int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0
    if len(data) >= 84 and len(data) == 84 + 50 * promised:
        return _binary(data, promised, limits)
    if data.lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid" and _LOOP.search(data):
        return _text(data, limits)
    if len(data) < 84 or len(data) < 84 + 50 * promised:
        raise malformed("stl", f"it is cut off: {promised} triangles are promised, {len(data)} bytes are there")
    return _binary(data, promised, limits)  # some exporters leave bytes behind the last triangle


def _binary(data: bytes, count: int, limits: Limits) -> Geometry:
    check_counts(3 * count // 2, count, limits)
    corners = np.frombuffer(data, _RECORD, count, offset=84)["corners"].reshape(-1, 3)
    return Geometry(corners.astype(np.float64), np.arange(3 * count).reshape(-1, 3))


def _text(data: bytes, limits: Limits) -> Geometry:
    check_counts(0, len(_LOOP.findall(data)), limits)
    numbers = [word for match in _VERTEX.finditer(data) for word in match.groups()]
    try:
        corners = np.array(numbers, dtype="S32").astype(np.float64).reshape(-1, 3)
    except ValueError as error:
        raise malformed("stl", "a coordinate is not a number") from error
    if not np.isfinite(corners).all():
        raise not_finite("A coordinate in the file is NaN or infinite.")
    if len(corners) % 3:
        raise malformed("stl", f"it has {len(corners)} corners, which are no whole triangles")
    return Geometry(corners, np.arange(len(corners)).reshape(-1, 3))
