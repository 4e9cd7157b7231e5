"""USD and USDZ through usd-core: metersPerUnit and upAxis are obeyed, nothing outside the file is opened."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Array, Geometry, Part, join
from roam_goalpose.objects.limits import Limits, check_counts
from roam_goalpose.objects.readers.polygons import triangulate
from roam_goalpose.objects.readers.scratch import scratch_folder

_LAYERS = (".usd", ".usda", ".usdc")
_MAX_PRIMS = 50_000
_UNPACKED = 4  # times the bytes that a plain file may have


def read_usd(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """One layer and those of `companions`; raises ObjectError."""
    layers = {path: content for path, content in companions.items() if path.lower().endswith(_LAYERS)}
    return _read({**layers, "upload.usd": data}, "upload.usd", limits)


def read_usdz(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """A package: its first layer is the scene; raises ObjectError."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = [one for one in archive.infolist() if one.filename.lower().endswith(_LAYERS)]
            if sum(one.file_size for one in entries) > _UNPACKED * limits.bytes:
                raise malformed("usdz", "its layers unpack to more than is read")
            layers = {one.filename: archive.open(one).read(one.file_size + 1) for one in entries}
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise malformed("usdz", "the package is damaged") from error
    if not layers:
        raise malformed("usdz", "it holds no USD layer")
    if any(PurePosixPath(path).is_absolute() or ".." in PurePosixPath(path).parts for path in layers):
        raise malformed("usdz", "a path in it leads out of the package")
    return _read(layers, next(iter(layers)), limits)


def _read(layers: Mapping[str, bytes], root: str, limits: Limits) -> Geometry:
    from pxr import Tf

    try:
        with scratch_folder(layers) as folder:
            _check_references(folder, layers)
            return _scene(folder / root, limits)
    except (ObjectError, MemoryError):
        raise
    except (Tf.ErrorException, RuntimeError, ValueError, TypeError, IndexError, OverflowError) as error:
        raise malformed("usd", "it is damaged, or its values are of the wrong kind") from error


def _check_references(folder: Path, layers: Mapping[str, bytes]) -> None:
    """Refuse layers that call for files other than those that came along; looked at before any is composed."""
    from pxr import Sdf

    for path in layers:
        layer = Sdf.Layer.FindOrOpen(str(folder / path))
        if layer is None:
            raise malformed("usd", "it is damaged")
        for asset in layer.GetCompositionAssetDependencies():
            target = (folder / path).parent / asset
            inside = target.resolve().is_relative_to(folder.resolve()) and target.exists()
            if not inside:
                raise ObjectError(
                    "OBJECT_EXTERNAL_FILE",
                    field="content",
                    message=f"The USD file refers to another file, {str(asset)[:80]!r}, which did not come with it.",
                    remedy="Export one USDZ file, or flatten it: usdcat --flatten scene.usd -o flat.usd.",
                )


def _scene(path: Path, limits: Limits) -> Geometry:
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    if stage is None:
        raise malformed("usd", "it is damaged")
    parts = list(_parts(stage, limits))
    geometry = join(parts)
    up = "z" if str(UsdGeom.GetStageUpAxis(stage)) == "Z" else "y"
    metres = float(UsdGeom.GetStageMetersPerUnit(stage))
    if not (np.isfinite(metres) and metres > 0):
        raise malformed("usd", f"its metersPerUnit is {metres}")
    found = Geometry(geometry.vertices, geometry.faces, up, metres, geometry.part, geometry.names)
    if not stage.HasAuthoredMetadata("metersPerUnit"):
        return found.noted(
            "OBJECT_UNIT_UNSURE",
            "The file does not say metersPerUnit: by the USD specification it is then in centimetres (0.01).",
        )
    return found


def _parts(stage: Any, limits: Limits) -> Iterator[Part]:
    """Every mesh that is shown, instances too, in the stage's own unit and axes."""
    from pxr import Usd, UsdGeom

    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    vertices = faces = 0
    for count, prim in enumerate(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())):
        if count > _MAX_PRIMS:
            raise malformed("usd", f"it has more than {_MAX_PRIMS} prims")
        image = UsdGeom.Imageable(prim)
        if not image or not _is_shown(image):
            continue
        for part in _shape(prim, np.array(cache.GetLocalToWorldTransform(prim), np.float64)):
            vertices += len(part.vertices)
            faces += 0 if part.faces is None else len(part.faces)
            check_counts(vertices, faces, limits)
            yield part


def _is_shown(image: Any) -> bool:
    from pxr import Usd, UsdGeom

    visible = image.ComputeVisibility(Usd.TimeCode.EarliestTime()) != UsdGeom.Tokens.invisible
    return visible and image.ComputePurpose() not in (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy)


def _shape(prim: Any, place: Array) -> Iterator[Part]:
    """What one prim draws: a mesh, points, or one of the simple solids."""
    from pxr import UsdGeom

    name = str(prim.GetParent().GetName() if prim.GetParent().GetTypeName() == "Xform" else prim.GetName())
    if prim.IsA(UsdGeom.PointInstancer):
        yield from _instanced(prim, place)
    elif any(parent.IsA(UsdGeom.PointInstancer) for parent in _above(prim)):
        return  # prototypes show only where their instancer puts them
    elif prim.IsA(UsdGeom.Mesh):
        yield _mesh(UsdGeom.Mesh(prim), name, place)
    elif prim.IsA(UsdGeom.Points):
        points = np.array(UsdGeom.Points(prim).GetPointsAttr().Get(_when()) or [], np.float64).reshape(-1, 3)
        yield Part(name, _placed(points, place), None)
    elif prim.IsA(UsdGeom.Cube):
        half = float(UsdGeom.Cube(prim).GetSizeAttr().Get() or 2.0) / 2
        corners = half * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
        yield Part(name, _placed(corners, place), np.array(_CUBE, np.int64))


def _mesh(mesh: Any, name: str, place: Array) -> Part:
    when = _when()
    points = np.array(mesh.GetPointsAttr().Get(when) if mesh.GetPointsAttr().Get(when) is not None else [], np.float64)
    sizes = np.array(mesh.GetFaceVertexCountsAttr().Get(when) or [], np.int64)
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(when) or [], np.int64)
    holes = np.array(mesh.GetHoleIndicesAttr().Get(when) or [], np.int64)
    points = points.reshape(-1, 3)
    if len(holes):
        sizes, corners = _without(sizes, corners, holes)
    return Part(name, _placed(points, place), triangulate(points, corners, sizes))


def _without(sizes: Any, corners: Any, holes: Any) -> tuple[Any, Any]:
    kept = np.ones(len(sizes), bool)
    kept[holes[(holes >= 0) & (holes < len(sizes))]] = False
    return sizes[kept], corners[np.repeat(kept, sizes)]


def _instanced(prim: Any, place: Array) -> Iterator[Part]:
    """Prototypes where a point instancer puts them."""
    from pxr import Usd, UsdGeom

    instancer, when = UsdGeom.PointInstancer(prim), _when()
    paths = instancer.GetPrototypesRel().GetForwardedTargets()
    which = list(instancer.GetProtoIndicesAttr().Get(when) or [])
    moves = instancer.ComputeInstanceTransformsAtTime(when, when)
    for number, move in zip(which, moves, strict=False):
        root = prim.GetStage().GetPrimAtPath(paths[number])
        cache = UsdGeom.XformCache(when)
        above = np.linalg.inv(np.array(cache.GetLocalToWorldTransform(root.GetParent()), np.float64))
        for below in Usd.PrimRange(root):
            if below.IsA(UsdGeom.Mesh):
                local = np.array(cache.GetLocalToWorldTransform(below), np.float64) @ above
                # ComputeInstanceTransforms already includes the prototype's own transform.
                own = np.linalg.inv(np.array(cache.GetLocalToWorldTransform(root), np.float64) @ above)
                yield _mesh(UsdGeom.Mesh(below), str(root.GetName()), local @ own @ np.array(move) @ place)


def _above(prim: Any) -> Iterator[Any]:
    parent = prim.GetParent()
    while parent and not parent.IsPseudoRoot():
        yield parent
        parent = parent.GetParent()


def _when() -> Any:
    from pxr import Usd

    return Usd.TimeCode.EarliestTime()


def _placed(points: Array, place: Array) -> Array:
    """Row vectors times USD's matrices."""
    return points @ place[:3, :3] + place[3, :3]


_CUBE = (
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
    (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
)  # fmt: skip
