"""Bytes and a format name → checked raw geometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from roam_goalpose.objects.errors import ObjectError, not_finite
from roam_goalpose.objects.geometry import Array, Geometry
from roam_goalpose.objects.limits import Limits, check_bytes, check_counts, check_points
from roam_goalpose.objects.readers.registry import check_content, check_format, find

# Beyond this float32 loses the millimetre, and squares overflow soon after; in any unit it is not furniture.
_MAX_COORDINATE = 1e9
_MIN_CLOUD_POINTS = 100
_KEPT_POINTS = 400_000  # of a cloud: 20 times what is sampled from it
_NOTHING: Mapping[str, bytes] = {}


def read_geometry(data: bytes, format: str, limits: Limits) -> Geometry:
    """Parse `data` and check that what came out is finite and not empty.

    Raises:
        ObjectError: with field `format` or `content`.
    """
    format = check_format(format)
    check_bytes(len(data), limits)
    check_content(data, format)
    return _checked(find(format).load()(data, limits, _NOTHING), limits)


def _checked(geometry: Geometry, limits: Limits) -> Geometry:
    """Drop unused vertices and missing returns, thin what is too dense, refuse what cannot be computed with."""
    faces = geometry.faces
    if len(geometry.vertices) == 0:
        raise _empty()
    if faces is None or not len(faces):
        check_points(len(geometry.vertices), limits)
        return _cloud(replace(geometry, faces=None, part=None, names=()))
    check_counts(len(geometry.vertices), len(faces), limits)
    if faces.min() < 0 or faces.max() >= len(geometry.vertices):
        raise ObjectError(
            "OBJECT_MALFORMED",
            field="content",
            message="A face refers to a vertex that is not in the file.",
            remedy="Export the mesh again; the file is incomplete.",
        )
    used = np.zeros(len(geometry.vertices), dtype=bool)
    used[faces] = True
    if used.all():
        _check_finite(geometry.vertices)
        return geometry
    vertices = geometry.vertices[used]
    _check_finite(vertices)
    renumber = np.cumsum(used) - 1
    return replace(geometry, vertices=vertices, faces=renumber[faces])


def _cloud(cloud: Geometry) -> Geometry:
    """Finite points, at most `_KEPT_POINTS`."""
    points = cloud.vertices
    there = (np.abs(points) < _MAX_COORDINATE).all(axis=1)  # NaN compares false
    dropped = len(points) - int(there.sum())
    if dropped:
        points = points[there]
        cloud = replace(cloud, vertices=points).noted(
            "OBJECT_POINTS_DROPPED",
            f"{dropped} points without a place (NaN, infinite) were left out; {len(points)} stay.",
        )
    if not len(points):
        raise not_finite("No point of the cloud has a finite place.")
    _check_cloud_size(len(points))
    if len(points) <= _KEPT_POINTS:
        return cloud
    steps = (np.arange(_KEPT_POINTS) * (len(points) / _KEPT_POINTS)).astype(np.int64)
    return replace(cloud, vertices=points[steps])


def _check_finite(vertices: Array) -> None:
    low, high = vertices.min(), vertices.max()
    if low > -_MAX_COORDINATE and high < _MAX_COORDINATE:  # NaN compares false
        return
    bad = np.flatnonzero(~(np.abs(vertices) < _MAX_COORDINATE).all(axis=1))
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
