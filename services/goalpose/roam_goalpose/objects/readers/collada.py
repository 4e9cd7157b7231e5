"""COLLADA (.dae) through pycollada: the scene's unit, up axis and node transforms are obeyed."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Geometry, Part, join
from roam_goalpose.objects.limits import Limits, check_counts
from roam_goalpose.objects.readers.polygons import triangulate

_UPS = {"X_UP": "x", "Y_UP": "y", "Z_UP": "z"}
_MAX_NODES = 20_000


def read_dae(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """All meshes that the scene shows, in the file's own unit and axes; raises ObjectError."""
    if b"<!ENTITY" in data or b"<!DOCTYPE" in data:
        raise malformed("dae", "it defines XML entities, which are never expanded")
    import collada
    from collada import common

    try:
        document = collada.Collada(io.BytesIO(data), ignore=[common.DaeUnsupportedError, common.DaeBrokenRefError])
        if document.scene is None:
            raise malformed("dae", "it has no scene")
        parts = list(_parts(document, limits))
        up = _UPS.get(str(document.assetInfo.upaxis or "Y_UP"), "y")
        metres = float(document.assetInfo.unitmeter or 1.0)
    except (ObjectError, MemoryError):
        raise
    except Exception as error:  # the parser raises whatever a broken file makes it trip over
        raise malformed("dae", "its structure is not that of COLLADA") from error
    if not (np.isfinite(metres) and metres > 0):
        raise malformed("dae", f"its unit is {metres} m")
    geometry = join(parts)
    return Geometry(geometry.vertices, geometry.faces, up, metres, geometry.part, geometry.names)


def _parts(document: Any, limits: Limits) -> Iterator[Part]:
    """Every geometry that a node shows, placed."""
    vertices = faces = 0
    for count, bound in enumerate(document.scene.objects("geometry")):
        if count > _MAX_NODES:
            raise malformed("dae", f"it shows more than {_MAX_NODES} geometries")
        for primitive in bound.primitives():
            part = _part(str(bound.original.name or bound.original.id or ""), primitive)
            if part is None:
                continue
            vertices += len(part.vertices)
            faces += 0 if part.faces is None else len(part.faces)
            check_counts(vertices, faces, limits)
            yield part


def _part(name: str, primitive: Any) -> Part | None:
    kind = type(primitive).__name__
    if primitive.vertex is None or "Line" in kind:
        return None
    vertices = np.asarray(primitive.vertex, np.float64).reshape(-1, 3)
    index = np.asarray(primitive.vertex_index, np.int64)
    if "Triangle" in kind:
        return Part(name, vertices, index.reshape(-1, 3))
    if "Poly" not in kind:
        return None
    original = primitive.original
    sizes = np.asarray(getattr(original, "vcounts", original.polyends - original.polystarts), np.int64)
    return Part(name, vertices, triangulate(vertices, index.ravel(), sizes))
