"""Autodesk FBX through ufbx: unit scale and axes of the file are obeyed.

The binding, version 0.0.5, is young: asking twice for the same list may return a freed one. Every list is asked for
once and kept, the file is read twice and the two readings must agree, and the process reads no other file afterwards
(`Format.fragile`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Geometry, Part, join
from roam_goalpose.objects.limits import Limits, check_counts
from roam_goalpose.objects.readers.polygons import triangulate

_UPS = ("x", "-x", "y", "-y", "z", "-z")  # ufbx's order of axes
_MAX_NODES = 20_000
_KEPT: list[Any] = []


def read_fbx(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """All meshes that nodes show, in the file's own unit and axes; raises ObjectError."""
    first, second = _read(data, limits), _read(data, limits)
    same = np.array_equal(first.vertices, second.vertices, equal_nan=True)
    both = first.faces is not None and second.faces is not None
    if not same or (both and not np.array_equal(first.faces, second.faces)):  # type: ignore[arg-type]
        raise malformed("fbx", "its vertices do not read the same twice")
    return first


def _read(data: bytes, limits: Limits) -> Geometry:
    import ufbx

    try:
        scene = ufbx.load_memory(data, ignore_animation=True, ignore_embedded=True)
        settings, nodes = scene.settings, list(scene.nodes)
        _KEPT.extend([scene, settings, nodes])
        axes, metres = settings.axes, float(settings.unit_meters)
        if len(nodes) > _MAX_NODES:
            raise malformed("fbx", f"it has {len(nodes)} nodes; at most {_MAX_NODES} are read")
        geometry = join(list(_parts(nodes, limits)))
    except (ObjectError, MemoryError):
        raise
    except Exception as error:  # the binding has several kinds
        raise malformed("fbx", "it is damaged, or older than FBX 6") from error
    if not (np.isfinite(metres) and metres > 0):
        raise malformed("fbx", f"its unit is {metres} m")
    up = _UPS[int(axes.up)] if 0 <= int(axes.up) < len(_UPS) else "y"
    return Geometry(geometry.vertices, geometry.faces, up, metres, geometry.part, geometry.names)


def _parts(nodes: list[Any], limits: Limits) -> Iterator[Part]:
    vertices = faces = 0
    for node in nodes:
        mesh = node.mesh
        if mesh is None or not node.visible:
            continue
        part = _part(node, mesh)
        vertices += len(part.vertices)
        faces += 0 if part.faces is None else len(part.faces)
        check_counts(vertices, faces, limits)
        yield part


def _part(node: Any, mesh: Any) -> Part:
    lists = mesh.vertices, mesh.vertex_indices, mesh.faces
    _KEPT.extend([mesh, *lists])
    points = np.array(lists[0], np.float64).reshape(-1, 3)
    corners = np.array(lists[1], np.int64).ravel()
    sizes = np.array([face.num_indices for face in lists[2]], np.int64)
    agree = len(points) == mesh.num_vertices and len(corners) == mesh.num_indices and len(sizes) == mesh.num_faces
    if not agree or sizes.sum() != len(corners) or corners.min(initial=0) < 0 or corners.max(initial=-1) >= len(points):
        raise malformed("fbx", "its vertices do not agree with its counts")
    matrix = node.geometry_to_world
    columns = [np.array([column.x, column.y, column.z]) for column in (matrix.c0, matrix.c1, matrix.c2, matrix.c3)]
    return Part(str(node.name), points @ np.stack(columns[:3]) + columns[3], triangulate(points, corners, sizes))
