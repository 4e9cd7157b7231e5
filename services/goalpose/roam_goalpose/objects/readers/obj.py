"""Wavefront OBJ through tinyobjloader: relative indices, groups, polygons of any shape."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import tinyobjloader

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Array, Geometry, Indices
from roam_goalpose.objects.limits import Limits, check_counts
from roam_goalpose.objects.readers.polygons import triangulate

# tinyobjloader takes words behind the coordinates for a weight or a colour, and does not join lines that end with \.
_COMMENT = re.compile(rb"#[^\n\r]*")
_JOINED = re.compile(rb"\\[ \t]*\r?\n")
_NOT_A_NUMBER = re.compile(rb"(?i)(?<![\w.])[-+]?(nan|inf|1\.#)\w*")
_HUGE = b"1e30"  # stands for what is no number: refused where a face uses it
_BROKEN = re.compile(rb"(?im)^[ \t]*v[ \t][^\n]*(nan|inf|1\.#)[^\n]*$")
_VERTEX = re.compile(rb"(?m)^[ \t]*v[ \t]")
_FACE = re.compile(rb"(?m)^[ \t]*f[ \t]")


def read_obj(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """Faces by object and group; without any face the vertices are a cloud. Materials are not looked at.

    Raises:
        ObjectError: whatever is wrong with the content.
    """
    text = data.removeprefix(b"\xef\xbb\xbf")
    if text[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = text.decode("utf-16", errors="replace").encode()
    if b"\0" in text:
        raise malformed("obj", "it is binary, OBJ is text")
    text = _COMMENT.sub(b"", _JOINED.sub(b" ", text))
    if b"\n" not in text:
        text = text.replace(b"\r", b"\n")
    check_counts(len(_VERTEX.findall(text)), len(_FACE.findall(text)), limits)
    if _NOT_A_NUMBER.search(text):
        text = _BROKEN.sub(lambda line: _NOT_A_NUMBER.sub(_HUGE, line.group()), text)
    reader = _parsed(text)
    # Not through the binding's numpy_* accessors: in 2.0.0rc13 all entries hold the first value.
    vertices = np.array(reader.GetAttrib().vertices, np.float64).reshape(-1, 3)
    faces: list[Indices] = []
    part: list[Indices] = []
    names: list[str] = []
    for shape in reader.GetShapes():
        sizes = np.array(shape.mesh.num_face_vertices, np.int64)
        if not len(sizes):
            continue
        corners = np.array(shape.mesh.vertex_indices(), np.int64)
        cut = _cut(vertices, corners, sizes, limits)
        faces.append(cut)
        part.append(np.full(len(cut), len(names)))
        names.append(str(shape.name))
    if not faces:
        return Geometry(vertices, None)
    return Geometry(vertices, np.concatenate(faces), part=np.concatenate(part), names=tuple(names))


def _parsed(text: bytes) -> tinyobjloader.ObjReader:
    config = tinyobjloader.ObjReaderConfig()
    config.triangulate = False
    reader = tinyobjloader.ObjReader()
    understood = reader.ParseFromString(text.decode("utf-8", errors="replace"), "", config)
    if not understood or not reader.Valid():
        raise malformed("obj", (str(reader.Error()).strip().splitlines() or ["no line is understood"])[0][:120])
    if "out of bounds" in str(reader.Warning()) and "Vertex indices" in str(reader.Warning()):
        raise ObjectError(
            "OBJECT_MALFORMED",
            field="content",
            message="A face refers to a vertex that is not in the file.",
            remedy="Export the mesh again; the file is incomplete.",
        )
    return reader


def _cut(vertices: Array, corners: Indices, sizes: Indices, limits: Limits) -> Indices:
    check_counts(0, int(np.maximum(sizes - 2, 0).sum()), limits)
    try:
        return triangulate(vertices, corners, sizes)
    except ValueError as error:
        raise malformed("obj", str(error)) from error
