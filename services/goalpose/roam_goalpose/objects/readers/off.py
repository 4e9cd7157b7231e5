"""OFF, the Object File Format of Geomview, text only: with normals and colours too, which are not looked at."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Geometry
from roam_goalpose.objects.limits import Limits, check_counts
from roam_goalpose.objects.readers.polygons import triangulate

_COMMENT = re.compile(rb"#[^\n]*")
_HEAD = re.compile(rb"^\s*(ST)?(C)?(N)?(4)?(n)?OFF\b")


def read_off(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """Polygons of any size; without any face the vertices are a cloud; raises ObjectError."""
    text = _COMMENT.sub(b"", data.removeprefix(b"\xef\xbb\xbf"))
    head = _HEAD.match(text)
    if head and (head.group(4) or head.group(5)):
        raise malformed("off", "its points have another number of dimensions than three")
    lines = [line for line in text[head.end() if head else 0 :].splitlines() if line.strip()]
    if b"BINARY" in (lines[0] if lines else b""):
        raise malformed("off", "it is a binary OFF; only text is read")
    try:
        vertex_count, face_count = (int(word) for word in lines[0].split()[:2])
        check_counts(vertex_count, face_count, limits)
        if vertex_count < 0 or face_count < 0 or vertex_count + face_count > len(lines) - 1:
            raise malformed("off", f"it is cut off: {vertex_count + face_count} lines are promised")
        rows = [line.split(None, 3)[:3] for line in lines[1 : 1 + vertex_count]]
        vertices = np.array(rows, dtype="S32").astype(np.float64).reshape(-1, 3)
        polygons = [line.split() for line in lines[1 + vertex_count : 1 + vertex_count + face_count]]
        sizes = np.array([int(words[0]) for words in polygons], np.int64)
        corners = [int(word) for words, size in zip(polygons, sizes, strict=True) for word in words[1 : 1 + size]]
        check_counts(0, int(np.maximum(sizes - 2, 0).sum()), limits)
        faces = triangulate(vertices, np.array(corners, np.int64), sizes)
    except ObjectError:
        raise
    except (ValueError, IndexError, OverflowError) as error:
        raise malformed("off", "a line does not hold the numbers that its place asks for") from error
    return Geometry(vertices, faces if len(faces) else None)
