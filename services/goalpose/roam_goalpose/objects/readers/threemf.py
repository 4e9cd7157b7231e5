"""3MF: the printing format's core and production parts, in its declared unit, Z up."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from lxml import etree

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Array, Geometry, Part, join
from roam_goalpose.objects.limits import Limits, check_counts

# 3MF core specification 1.3, section 3.4.
_UNITS: Mapping[str, float] = {
    "micron": 1e-6, "millimeter": 0.001, "centimeter": 0.01, "inch": 0.0254, "foot": 0.3048, "meter": 1.0,
}  # fmt: skip
_MAX_DEPTH = 16
_MAX_PARTS = 20_000
_UNPACKED = 4  # times the bytes that a plain file may have


def read_3mf(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """All items of the build plate, placed; raises ObjectError."""
    try:
        models = _models(data, limits)
        root = next(model for path, model in models.items() if path.lower().endswith("3d/3dmodel.model"))
        unit = root.get("unit", "millimeter")
        if unit not in _UNITS:
            raise malformed("3mf", f"its unit {unit[:20]!r} is none of 3MF's")
        parts = list(_Plate(models, limits).parts(root))
    except (ObjectError, MemoryError):
        raise
    except StopIteration as error:
        raise malformed("3mf", "it holds no 3D/3dmodel.model") from error
    except Exception as error:  # whatever a broken archive or XML makes the parsers trip over
        raise malformed("3mf", "its archive or its model is damaged") from error
    geometry = join(parts)
    return Geometry(geometry.vertices, geometry.faces, "z", _UNITS[unit], geometry.part, geometry.names)


def _models(data: bytes, limits: Limits) -> dict[str, Any]:
    """The parsed model files by path."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=False, load_dtd=False)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = [entry for entry in archive.infolist() if entry.filename.lower().endswith(".model")]
        if sum(entry.file_size for entry in entries) > _UNPACKED * limits.bytes:
            raise malformed("3mf", "its models unpack to more than is read")
        models = {}
        for entry in entries:
            with archive.open(entry) as stream:
                models["/" + entry.filename.lstrip("/")] = etree.fromstring(stream.read(entry.file_size + 1), parser)
    return models


class _Plate:
    """Objects by file and id, and their placement."""

    def __init__(self, models: Mapping[str, Any], limits: Limits) -> None:
        self._limits = limits
        self._objects = {
            (path, node.get("id")): node
            for path, model in models.items()
            for node in model.iter()
            if _tag(node) == "object"
        }
        self._paths = {id(model): path for path, model in models.items()}
        self._faces = self._vertices = self._count = 0

    def parts(self, root: Any) -> Iterator[Part]:
        """What the build shows; without a build everything that is no component of another object."""
        path = self._paths[id(root)]
        items = [node for node in root.iter() if _tag(node) == "item"]
        for item in items:
            yield from self._object(_path(item) or path, item.get("objectid"), _matrix(item.get("transform")), 0)
        if not items:
            for owner, name in list(self._objects):
                yield from self._object(owner, name, np.eye(4), 0)

    def _object(self, path: str, name: str | None, place: Array, depth: int) -> Iterator[Part]:
        node = self._objects[path, name]
        self._count += 1
        if depth > _MAX_DEPTH or self._count > _MAX_PARTS:
            raise malformed("3mf", "its components hang from themselves, or are too many")
        if node.get("type", "model") not in ("model", "solidsupport"):
            return
        for child in node:
            if _tag(child) == "mesh":
                yield self._mesh(child, str(node.get("name") or ""), place)
            for part in child if _tag(child) == "components" else ():
                matrix = place @ _matrix(part.get("transform"))
                yield from self._object(_path(part) or path, part.get("objectid"), matrix, depth + 1)

    def _mesh(self, mesh: Any, name: str, place: Array) -> Part:
        groups = {_tag(child): child for child in mesh}
        vertices = np.array([[node.get(axis) for axis in "xyz"] for node in groups["vertices"]], "S32")
        faces = np.array([[node.get(corner) for corner in ("v1", "v2", "v3")] for node in groups["triangles"]], "S16")
        self._vertices += len(vertices)
        self._faces += len(faces)
        check_counts(self._vertices, self._faces, self._limits)
        points = vertices.astype(np.float64).reshape(-1, 3) @ place[:3, :3].T + place[:3, 3]
        return Part(name, points, faces.astype(np.int64).reshape(-1, 3))


def _tag(node: Any) -> str:
    return node.tag.rpartition("}")[2] if isinstance(node.tag, str) else ""


def _path(node: Any) -> str | None:
    """The production extension's path to another model file."""
    return next((value for key, value in node.attrib.items() if key.endswith("}path")), None)


def _matrix(text: str | None) -> Array:
    matrix = np.eye(4)
    if text:
        matrix[:3] = np.array([float(word) for word in text.split()]).reshape(4, 3).T
    return matrix
