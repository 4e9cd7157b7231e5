"""Autodesk FBX through ufbx: unit scale and axes of the file are obeyed.

The binding's arrays are checked against what its other accessors say, and against the file's own counts: version 0.0.5
has been seen to return arrays that were not the mesh's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Array, Geometry, Part, join
from roam_goalpose.objects.limits import Limits, check_counts
from roam_goalpose.objects.readers.polygons import triangulate

_UPS = ("x", "-x", "y", "-y", "z", "-z")  # ufbx's order of axes
_MAX_NODES = 20_000
_SPOT_CHECKS = 16


def read_fbx(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """All meshes that nodes show, in the file's own unit and axes; raises ObjectError."""
    import ufbx

    try:
        scene = ufbx.load_memory(data, ignore_animation=True, ignore_embedded=True)
        up = int(scene.settings.axes.up)
        metres = float(scene.settings.unit_meters)
        if len(scene.nodes) > _MAX_NODES:
            raise malformed("fbx", f"it has {len(scene.nodes)} nodes; at most {_MAX_NODES} are read")
        parts = list(_parts(scene, limits))
    except (ObjectError, MemoryError):
        raise
    except Exception as error:  # the binding has several kinds
        raise malformed("fbx", "it is damaged, or older than FBX 6") from error
    if not (np.isfinite(metres) and metres > 0):
        raise malformed("fbx", f"its unit is {metres} m")
    geometry = join(parts)
    return Geometry(
        geometry.vertices,
        geometry.faces,
        _UPS[up] if 0 <= up < len(_UPS) else "y",
        metres,
        geometry.part,
        geometry.names,
    )


def _parts(scene: Any, limits: Limits) -> Iterator[Part]:
    vertices = faces = 0
    for node in scene.nodes:
        mesh = node.mesh
        if mesh is None or not node.visible:
            continue
        part = _part(node, mesh)
        vertices += len(part.vertices)
        faces += 0 if part.faces is None else len(part.faces)
        check_counts(vertices, faces, limits)
        yield part


def _part(node: Any, mesh: Any) -> Part:
    points = np.array(mesh.vertices, np.float64).reshape(-1, 3)
    corners = np.array(mesh.vertex_indices, np.int64).ravel()
    sizes = np.array([face.num_indices for face in mesh.faces], np.int64)
    _cross_check(mesh, points, corners, sizes)
    return Part(str(node.name), _placed(points, node.geometry_to_world), triangulate(points, corners, sizes))


def _cross_check(mesh: Any, points: Array, corners: Any, sizes: Any) -> None:
    """Arrays against counts, and some of their rows against the same values one by one."""
    agree = len(points) == mesh.num_vertices and len(corners) == mesh.num_indices and len(sizes) == mesh.num_faces
    for row in np.linspace(0, max(len(points) - 1, 0), min(_SPOT_CHECKS, len(points))).astype(int) if agree else ():
        one = mesh.vertices[int(row)]
        agree = agree and np.array_equal(points[row], [one.x, one.y, one.z], equal_nan=True)
    agree = agree and (not len(corners) or (corners.min() >= 0 and corners.max() < len(points)))
    if not agree or sizes.sum() != len(corners):
        raise malformed("fbx", "its vertices do not agree with its counts")


def _placed(points: Array, matrix: Any) -> Array:
    columns = [np.array([column.x, column.y, column.z]) for column in (matrix.c0, matrix.c1, matrix.c2, matrix.c3)]
    return points @ np.stack(columns[:3]) + columns[3]
