"""The formats that are read: one row each, in one table that others can add to.

A format is a module with a reader and a row here. A reader from elsewhere joins at run time::

    register(Format("facets", "Facets text", ("facets",), "my_package.facets:read", begins=(b"FACETS",)))

`my_package.facets` then also runs in the child process that reads uploads, which imports it by that name.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING

from roam_goalpose.objects.errors import ObjectError

if TYPE_CHECKING:
    from roam_goalpose.objects.geometry import Geometry
    from roam_goalpose.objects.limits import Limits

Read = Callable[[bytes, "Limits", Mapping[str, bytes]], "Geometry"]
"""A file's bytes, the bounds on it and the files that came beside it → raw geometry; raises ObjectError."""


@dataclass(frozen=True)
class Format:
    """A file format that is read.

    Attributes:
        name: how requests name it, lower case.
        title: how people call it.
        extensions: of file names, without the dot, lower case.
        read: `package.module:function`, a `Read`; imported when the first file of the format comes.
        media_types: of HTTP's Content-Type.
        begins: first bytes that no file of another format here has.
        looks: tells by more than the first bytes that data are in this format.
        unit: what fixes the unit of its numbers: `m` by its specification, `file` when the file says it, empty when
            nothing does.
        up: the same for its up axis: `y`, `z`, `file` or empty.
        module: package that must be installed beside the service's own, by the extra `formats`; empty for none.
        fragile: its library may leave the process in a bad state: the process reads no other file after it.
    """

    name: str
    title: str
    extensions: tuple[str, ...]
    read: str
    media_types: tuple[str, ...] = ()
    begins: tuple[bytes, ...] = ()
    looks: Callable[[bytes], bool] | None = None
    unit: str = ""
    up: str = ""
    module: str = ""
    fragile: bool = False

    def load(self) -> Read:
        """The reader; OBJECT_FORMAT_UNSUPPORTED when its library is not installed here."""
        module, _, function = self.read.partition(":")
        try:
            if self.module:
                importlib.import_module(self.module)
        except ImportError as error:
            raise ObjectError(
                "OBJECT_FORMAT_UNSUPPORTED",
                field="format",
                message=f"{self.title} is read with {self.module}, which is not installed on this server.",
                remedy="Install the extra `formats` (pip install roam-services[formats]), or send GLB.",
            ) from error
        read: Read = getattr(importlib.import_module(module), function)
        return read


def _is_off(data: bytes) -> bool:
    return _text(data).startswith((b"OFF", b"COFF", b"NOFF", b"CNOFF", b"STOFF"))


def _is_json(data: bytes) -> bool:
    return _text(data).startswith(b"{")


def _is_collada(data: bytes) -> bool:
    return _text(data).startswith(b"<") and b"COLLADA" in data[:2048]


def _is_text_stl(data: bytes) -> bool:
    return _text(data)[:5].lower() == b"solid" and b"facet" in data[:4096].lower()


def _is_3mf(data: bytes) -> bool:
    return data.startswith(b"PK\x03\x04") and b"3dmodel.model" in data[:65536] + data[-65536:]


def _is_usdz(data: bytes) -> bool:
    # A package is an uncompressed ZIP whose first file is a USD layer.
    return data.startswith(b"PK\x03\x04") and any(end in data[30:300].lower() for end in (b".usdc", b".usda", b".usd"))


def _is_zip(data: bytes) -> bool:
    return data.startswith((b"PK\x03\x04", b"PK\x05\x06")) and not _is_3mf(data) and not _is_usdz(data)


def _text(data: bytes) -> bytes:
    return data[:1024].lstrip(b"\xef\xbb\xbf \t\r\n")


_HERE = "roam_goalpose.objects.readers"

_FORMATS: dict[str, Format] = {
    row.name: row
    for row in (
        Format(
            "glb",
            "binary glTF",
            ("glb", "vrm"),
            f"{_HERE}.gltf:read_glb",
            ("model/gltf-binary",),
            (b"glTF",),
            None,
            "m",
            "y",
        ),
        Format("gltf", "glTF", ("gltf",), f"{_HERE}.gltf:read_gltf", ("model/gltf+json",), (), _is_json, "m", "y"),
        Format("obj", "Wavefront OBJ", ("obj",), f"{_HERE}.obj:read_obj", ("model/obj",)),
        Format("ply", "PLY", ("ply",), f"{_HERE}.ply:read_ply", ("model/ply",), (b"ply\n", b"ply\r")),
        Format("stl", "STL", ("stl",), f"{_HERE}.stl:read_stl", ("model/stl", "application/sla"), (), _is_text_stl),
        Format("off", "OFF", ("off",), f"{_HERE}.off:read_off", (), (), _is_off),
        Format(
            "xyz",
            "XYZ, PTS or CSV text",
            ("xyz", "pts", "csv", "asc", "txt", "xyzn", "xyzrgb"),
            f"{_HERE}.points:read_xyz",
            ("text/csv",),
        ),
        Format("pcd", "PCD", ("pcd",), f"{_HERE}.pcd:read_pcd", (), (b"# .PCD",)),
        Format("npy", "NumPy array", ("npy",), f"{_HERE}.points:read_npy", (), (b"\x93NUMPY",)),
        Format(
            "usd",
            "USD",
            ("usd", "usda", "usdc"),
            f"{_HERE}.usd:read_usd",
            ("model/vnd.usda",),
            (b"PXR-USDC", b"#usda"),
            None,
            "file",
            "file",
            "pxr",
        ),
        Format(
            "usdz",
            "USDZ",
            ("usdz",),
            f"{_HERE}.usd:read_usdz",
            ("model/vnd.usdz+zip",),
            (),
            _is_usdz,
            "file",
            "file",
            "pxr",
        ),
        Format(
            "fbx",
            "Autodesk FBX",
            ("fbx",),
            f"{_HERE}.fbx:read_fbx",
            (),
            (b"Kaydara FBX Binary", b"; FBX"),
            None,
            "file",
            "file",
            "ufbx",
            fragile=True,
        ),
        Format(
            "dae",
            "COLLADA",
            ("dae",),
            f"{_HERE}.collada:read_dae",
            ("model/vnd.collada+xml",),
            (),
            _is_collada,
            "file",
            "file",
        ),
        Format("3mf", "3MF", ("3mf",), f"{_HERE}.threemf:read_3mf", ("model/3mf",), (), _is_3mf, "file", "z"),
        Format("las", "LAS or LAZ", ("las", "laz"), f"{_HERE}.lidar:read_las", (), (b"LASF",), None, "m", "z", "laspy"),
        Format(
            "e57", "E57", ("e57",), f"{_HERE}.lidar:read_e57", ("model/e57",), (b"ASTM-E57",), None, "m", "z", "pye57"
        ),
        Format(
            "zip",
            "ZIP of an object and what it refers to",
            ("zip",),
            f"{_HERE}.archive:read_zip",
            ("application/zip", "application/x-zip-compressed"),
            (),
            _is_zip,
            "file",
            "file",
        ),
    )
}
_added: list[str] = []


class Formats(Sequence[str]):
    """The names of all formats, those that were registered later too."""

    def __getitem__(self, index: int | slice) -> str | tuple[str, ...]:  # type: ignore[override]
        return tuple(_FORMATS)[index]

    def __len__(self) -> int:
        return len(_FORMATS)

    def __iter__(self) -> Iterator[str]:
        return iter(tuple(_FORMATS))

    def __contains__(self, name: object) -> bool:
        return name in _FORMATS


FORMATS = Formats()


def register(format: Format) -> None:
    """Add a format, or put another reader in place of one; its module is imported by its name in child processes."""
    _FORMATS[format.name] = format
    module = format.read.partition(":")[0]
    if module not in _added:
        _added.append(module)


def added_modules() -> tuple[str, ...]:
    """Modules of readers that were registered from outside, for processes that must register them too."""
    return tuple(_added)


def find(name: str) -> Format:
    """The row of a canonical name."""
    return _FORMATS[name]


def media_types() -> dict[str, str]:
    """Content-Type → format name."""
    return {media_type: row.name for row in _FORMATS.values() for media_type in row.media_types}


# Names people send that are known but not read: what they are, and what makes something that is read of them.
_BLENDER = "In Blender: File > Import, then File > Export > glTF 2.0"
_UNPACK = "Unpack it and send the object file itself, or pack it as ZIP"
_CAD = "Convert it to STL, OBJ or glTF with FreeCAD (File > Export), CAD Assistant or gmsh"
UNSUPPORTED: Mapping[str, tuple[str, str]] = {
    "step": ("a STEP CAD model: exact surfaces, no triangles", _CAD),
    "iges": ("an IGES CAD model: exact surfaces, no triangles", _CAD),
    "skp": (
        "a SketchUp model",
        "In SketchUp: File > Export > 3D Model > COLLADA (.dae) or glTF; or import it with SimLab or Rhino",
    ),
    "3dm": ("a Rhino model", "In Rhino: File > Export Selected > glTF or OBJ"),
    "dwg": ("an AutoCAD drawing", "In AutoCAD: FBXEXPORT, or convert it with ODA File Converter and FreeCAD"),
    "dxf": ("an AutoCAD exchange drawing", _CAD),
    "ifc": ("a building model (IFC)", "Convert it with IfcConvert (IfcOpenShell): IfcConvert file.ifc file.glb"),
    "3ds": ("a 3D Studio model", "In Blender with its add-on for 3DS, or: assimp export file.3ds file.glb"),
    "max": ("a 3ds Max scene", "In 3ds Max: File > Export > FBX or glTF"),
    "blend": ("a Blender project", "In Blender: File > Export > glTF 2.0"),
    "c4d": ("a Cinema 4D project", "In Cinema 4D: File > Export > glTF or FBX"),
    "ma": ("a Maya scene", "In Maya: File > Export All > FBX"),
    "abc": ("an Alembic cache", _BLENDER),
    "x3d": ("an X3D scene", _BLENDER),
    "wrl": ("a VRML scene", "In MeshLab: File > Export Mesh As > PLY or OBJ"),
    "rvm": ("a PDMS model", _CAD),
    "ptx": ("a Leica PTX scan", "In CloudCompare: File > Save > PLY or LAS"),
    "rcp": ("an Autodesk ReCap project", "In ReCap: Export > E57 or PTS"),
    "splat": ("a Gaussian splat, which has no surface", "Send a mesh or a point cloud of the same scan"),
    "gz": ("a gzip archive", _UNPACK),
    "bz2": ("a bzip2 archive", _UNPACK),
    "xz": ("an xz archive", _UNPACK),
    "7z": ("a 7-Zip archive", _UNPACK),
    "rar": ("a RAR archive", _UNPACK),
    "tar": ("a tar archive", _UNPACK),
    "pkl": ("a Python pickle, which is never opened", "Save a plain array of points: numpy.save(file, points)"),
    "npz": ("a NumPy archive", "Save one array [N, 3]: numpy.save(file, points)"),
    "png": ("a PNG image", "Send a 3D object"),
    "jpg": ("a JPEG image", "Send a 3D object"),
    "pdf": ("a PDF document", "Send a 3D object"),
    "html": ("a web page: the download may have failed", "Download the object file again and send that"),
}
_OTHER_NAMES = {
    "stp": "step",
    "igs": "iges",
    "p21": "step",
    "mb": "ma",
    "tgz": "gz",
    "jpeg": "jpg",
    "htm": "html",
    "vrml": "wrl",
    "rcs": "rcp",
}

_FOREIGN: tuple[tuple[bytes, str], ...] = (
    (b"ISO-10303-21", "step"),
    (b"\xff\xfe\xff\x0eS\x00k\x00e\x00t\x00c\x00h\x00U\x00p", "skp"),
    (b"3D Geometry File Format", "3dm"),
    (b"AC10", "dwg"),
    (b"BLENDER", "blend"),
    (b"#VRML", "wrl"),
    (b"\x1f\x8b", "gz"),
    (b"BZh", "bz2"),
    (b"\xfd7zXZ", "xz"),
    (b"7z\xbc\xaf", "7z"),
    (b"Rar!", "rar"),
    (b"\x80\x02", "pkl"),
    (b"\x80\x03", "pkl"),
    (b"\x80\x04", "pkl"),
    (b"\x80\x05", "pkl"),
    (b"\x89PNG", "png"),
    (b"\xff\xd8\xff", "jpg"),
    (b"%PDF", "pdf"),
)


def format_of(path: str | os.PathLike[str]) -> str:
    """The format by file name extension; raises OBJECT_FORMAT_UNKNOWN or OBJECT_FORMAT_UNSUPPORTED."""
    suffix = PurePath(path).suffix.lstrip(".")
    if not suffix:
        raise ObjectError(
            "OBJECT_FORMAT_UNKNOWN",
            field="format",
            message=f"The file name {PurePath(path).name!r} has no extension.",
            remedy=f"Name the format: {', '.join(FORMATS)}.",
        )
    return check_format(suffix)


def check_format(name: str) -> str:
    """The canonical (lower-case) format name; raises OBJECT_FORMAT_UNKNOWN or OBJECT_FORMAT_UNSUPPORTED."""
    format = name.strip().lstrip(".").lower()
    if format in _FORMATS:
        return format
    by_extension = next((row.name for row in _FORMATS.values() if format in row.extensions), None)
    if by_extension:
        return by_extension
    format = _OTHER_NAMES.get(format, format)
    if format in UNSUPPORTED:
        raise _unsupported(format, field="format")
    raise ObjectError(
        "OBJECT_FORMAT_UNKNOWN",
        field="format",
        message=f"The format {name[:40]!r} is not known.",
        remedy=f"Send one of: {', '.join(FORMATS)}.",
    )


def check_content(data: bytes, format: str) -> None:
    """Raise when the first bytes show plainly that `data` is not in `format`."""
    found = sniff(data)
    if found is None or found == format:
        return
    if found in UNSUPPORTED:
        raise _unsupported(found, field="content")
    raise ObjectError(
        "OBJECT_FORMAT_MISMATCH",
        field="format",
        message=f"The file is said to be {format.upper()} but its content is {found.upper()}.",
        remedy=f"Send it with the format {found!r} (or rename it to .{find(found).extensions[0]}).",
    )


def sniff(data: bytes) -> str | None:
    """The format that the first bytes prove, or None when they prove nothing (OBJ, XYZ and binary STL have no mark)."""
    head = data[:64]
    for row in _FORMATS.values():
        if row.begins and head.startswith(row.begins):
            return row.name
    for signature, format in _FOREIGN:
        if head.startswith(signature):
            return format
    text = _text(data).lower()
    if text.startswith((b"<!doctype html", b"<html")):
        return "html"
    return next((row.name for row in _FORMATS.values() if row.looks is not None and row.looks(data)), None)


def _unsupported(format: str, *, field: str) -> ObjectError:
    what, convert = UNSUPPORTED[format]
    return ObjectError(
        "OBJECT_FORMAT_UNSUPPORTED",
        field=field,
        message=f"The file is {what}, which is not read here.",
        remedy=f"{convert}; formats read: {', '.join(FORMATS)}.",
    )
