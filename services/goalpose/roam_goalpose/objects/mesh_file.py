"""OBJ, GLB, glTF, PLY, STL and OFF through trimesh, flattened to one soup of triangles in file coordinates."""

from __future__ import annotations

import io
import logging
import re
import struct
from typing import Any

import numpy as np
import trimesh
from trimesh.resolvers import Resolver

from roam_goalpose.objects.errors import ObjectError, malformed, not_finite
from roam_goalpose.objects.geometry import Array, Geometry, Indices
from roam_goalpose.objects.gltf import check_gltf
from roam_goalpose.objects.limits import Limits, check_counts

# trimesh logs whole tracebacks of the bad files it meets; the sender gets an ObjectError instead.
logging.getLogger("trimesh").setLevel(logging.CRITICAL)


class _Nothing(Resolver):
    """Answers every request for another file (materials, textures, buffers) with 'not there'."""

    def __init__(self) -> None:
        pass

    def get(self, name: str) -> bytes:
        raise FileNotFoundError(name)

    def keys(self) -> list[str]:
        return []

    def write(self, name: str, data: bytes) -> None:
        raise PermissionError(name)

    def namespaced(self, namespace: str) -> Resolver:
        return self


# What some exporters write for a broken coordinate; trimesh's text parsers stumble over it.
_NOT_A_NUMBER = re.compile(rb"(?i)(?<![a-z_])(nan|inf)(?![a-z_])")
_PLY_ELEMENT = re.compile(rb"element\s+(\w+)\s+(\d{1,18})\s")
_NOTHING = _Nothing()


def read_mesh_file(data: bytes, format: str, limits: Limits) -> Geometry:
    """Read a mesh file; without any face the vertices are taken as a point cloud.

    Raises:
        ObjectError: whatever is wrong with the content.
    """
    is_gltf = format in ("glb", "gltf")
    if is_gltf:
        data = check_gltf(data, format, limits)
    if format == "stl":
        _check_stl(data)
    if format == "ply":
        _check_ply(data, limits)
    try:
        scene = trimesh.load_scene(
            io.BytesIO(data),
            file_type=format,
            resolver=_NOTHING,
            process=False,
            skip_materials=True,
            allow_remote=False,
        )
        geometry = _flatten(scene, limits)
    except (ObjectError, MemoryError):
        raise
    except Exception as error:  # the parsers raise whatever a broken file makes them trip over
        if format in ("obj", "off", "ply", "stl") and _NOT_A_NUMBER.search(data):
            raise not_finite("A coordinate in the file is NaN or infinite.") from error
        raise malformed(format, f"{type(error).__name__}: {str(error)[:120]}") from error
    if is_gltf:
        return Geometry(geometry.vertices, geometry.faces, up="y", unit="m")
    return geometry


def _check_stl(data: bytes) -> None:
    """Refuse a binary STL that is shorter than its header says; trimesh would take it for text."""
    if data.lstrip()[:5] == b"solid":
        return
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= 84 else 0
    if len(data) < 84 + 50 * count or len(data) < 84:
        raise malformed("stl", f"it is cut off: {count} triangles are promised, {len(data)} bytes are there")


def _check_ply(data: bytes, limits: Limits) -> None:
    """Refuse a PLY whose header promises more than the limits or more elements than there are bytes."""
    header = data[: data.find(b"end_header")]
    counts = {name: int(count) for name, count in _PLY_ELEMENT.findall(header)}
    check_counts(counts.get(b"vertex", 0), counts.get(b"face", 0), limits)
    if max(counts.values(), default=0) > len(data):
        raise malformed(
            "ply", f"it is cut off: {max(counts.values())} elements are promised, {len(data)} bytes are there"
        )


def _flatten(scene: Any, limits: Limits) -> Geometry:
    """Place every instance of every sub-mesh and join them."""
    placed = [(scene.geometry[name], transform) for transform, name in _instances(scene)]
    check_counts(
        sum(len(part.vertices) for part, _ in placed),
        sum(len(getattr(part, "faces", ())) for part, _ in placed),
        limits,
    )
    vertices: list[Array] = []
    faces: list[Indices] = []
    loose: list[Array] = []
    start = 0
    for part, transform in placed:
        with np.errstate(all="ignore"):  # infinities are looked for afterwards
            points = np.asarray(part.vertices, dtype=np.float64) @ transform[:3, :3].T + transform[:3, 3]
        indices = np.asarray(getattr(part, "faces", np.zeros((0, 3))), dtype=np.int64)
        if len(indices) == 0:
            loose.append(points)
            continue
        # A mirrored instance turns its triangles inside out; turn them back.
        faces.append((indices[:, ::-1] if np.linalg.det(transform[:3, :3]) < 0 else indices) + start)
        vertices.append(points)
        start += len(points)
    if faces:
        return Geometry(np.concatenate(vertices), np.concatenate(faces))
    return Geometry(np.concatenate(loose) if loose else np.zeros((0, 3)), None)


def _instances(scene: Any) -> list[tuple[Array, str]]:
    return [
        (np.asarray(transform, dtype=np.float64), name)
        for transform, name in (scene.graph[node] for node in scene.graph.nodes_geometry)
    ]
