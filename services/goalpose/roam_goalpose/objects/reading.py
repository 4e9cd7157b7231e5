"""Bytes and a format name → checked raw geometry."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from roam_goalpose.objects.errors import ObjectError, not_finite
from roam_goalpose.objects.formats import check_content, check_format
from roam_goalpose.objects.geometry import Array, Geometry
from roam_goalpose.objects.limits import Limits, check_bytes, check_counts
from roam_goalpose.objects.mesh_file import read_mesh_file
from roam_goalpose.objects.pcd import read_pcd
from roam_goalpose.objects.point_file import read_npy, read_xyz

# Beyond this float32 loses the millimetre, and squares overflow soon after; in any unit it is not furniture.
_MAX_COORDINATE = 1e9
_MIN_CLOUD_POINTS = 100

_POINT_READERS: Mapping[str, Callable[[bytes, Limits], Geometry]] = {"xyz": read_xyz, "npy": read_npy, "pcd": read_pcd}


def read_geometry(data: bytes, format: str, limits: Limits) -> Geometry:
    """Parse `data` and check that what came out is finite and not empty.

    Raises:
        ObjectError: with field `format` or `content`.
    """
    format = check_format(format)
    check_bytes(len(data), limits)
    check_content(data, format)
    reader = _POINT_READERS.get(format)
    geometry = reader(data, limits) if reader else read_mesh_file(data, format, limits)
    return _checked(geometry, limits)


def _checked(geometry: Geometry, limits: Limits) -> Geometry:
    """Drop unused vertices, refuse what cannot be computed with."""
    faces = geometry.faces
    check_counts(len(geometry.vertices), 0 if faces is None else len(faces), limits)
    if len(geometry.vertices) == 0:
        raise _empty()
    if faces is None:
        _check_finite(geometry.vertices)
        _check_cloud_size(len(geometry.vertices))
        return geometry
    if faces.min() < 0 or faces.max() >= len(geometry.vertices):
        raise ObjectError(
            "OBJECT_MALFORMED",
            field="content",
            message="A face refers to a vertex that is not in the file.",
            remedy="Export the mesh again; the file is incomplete.",
        )
    used = np.zeros(len(geometry.vertices), dtype=bool)
    used[faces] = True
    vertices = geometry.vertices[used]
    _check_finite(vertices)
    renumber = np.cumsum(used) - 1
    return Geometry(vertices, renumber[faces], geometry.up, geometry.unit)


def _check_finite(vertices: Array) -> None:
    bad = np.flatnonzero(~(np.abs(vertices) < _MAX_COORDINATE).all(axis=1))  # NaN compares false
    if len(bad):
        raise not_finite(f"{len(bad)} of {len(vertices)} vertices are not finite or beyond 1e9; first number {bad[0]}.")


def _check_cloud_size(count: int) -> None:
    if count < _MIN_CLOUD_POINTS:
        raise ObjectError(
            "OBJECT_TOO_FEW_POINTS",
            field="content",
            message=f"There are no faces and only {count} points; a cloud needs at least {_MIN_CLOUD_POINTS}.",
            remedy="Send a mesh, or a denser point cloud (2,000 points or more work well).",
        )


def _empty() -> ObjectError:
    return ObjectError(
        "OBJECT_EMPTY",
        field="content",
        message="The file holds no vertices.",
        remedy="Check that the object was selected when it was exported.",
    )
