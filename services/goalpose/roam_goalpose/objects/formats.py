"""The formats that are read, and how to tell from the first bytes that a file is something else."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import PurePath

from roam_goalpose.objects.errors import ObjectError

FORMATS: tuple[str, ...] = ("glb", "gltf", "obj", "ply", "stl", "off", "xyz", "pcd", "npy")

# Names people send that we know but do not read, with what they are.
UNSUPPORTED: Mapping[str, str] = {
    "fbx": "Autodesk FBX",
    "dae": "COLLADA",
    "usd": "USD",
    "usda": "USD",
    "usdc": "USD",
    "usdz": "USD",
    "3ds": "3D Studio",
    "max": "3ds Max",
    "blend": "Blender",
    "step": "STEP CAD",
    "stp": "STEP CAD",
    "iges": "IGES CAD",
    "igs": "IGES CAD",
    "zip": "a ZIP archive",
    "gz": "a gzip archive",
    "bz2": "a bzip2 archive",
    "xz": "an xz archive",
    "7z": "a 7-Zip archive",
    "rar": "a RAR archive",
    "tar": "a tar archive",
    "pkl": "a Python pickle",
    "npz": "a NumPy archive",
    "las": "LAS lidar",
    "laz": "LAZ lidar",
    "e57": "E57 scan",
    "png": "a PNG image",
    "jpg": "a JPEG image",
}

# First bytes -> format. Only signatures that cannot begin a valid file of another format here.
_SIGNATURES: tuple[tuple[bytes, str], ...] = (
    (b"glTF", "glb"),
    (b"\x93NUMPY", "npy"),
    (b"ply\n", "ply"),
    (b"ply\r", "ply"),
    (b"# .PCD", "pcd"),
    (b"Kaydara FBX Binary", "fbx"),
    (b"; FBX", "fbx"),
    (b"PXR-USDC", "usdc"),
    (b"#usda", "usda"),
    (b"BLENDER", "blend"),
    (b"ISO-10303-21", "step"),
    (b"PK\x03\x04", "zip"),
    (b"PK\x05\x06", "zip"),
    (b"\x1f\x8b", "gz"),
    (b"BZh", "bz2"),
    (b"\xfd7zXZ", "xz"),
    (b"7z\xbc\xaf", "7z"),
    (b"Rar!", "rar"),
    (b"\x80\x02", "pkl"),
    (b"\x80\x03", "pkl"),
    (b"\x80\x04", "pkl"),
    (b"\x80\x05", "pkl"),
    (b"LASF", "las"),
    (b"ASTM-E57", "e57"),
    (b"\x89PNG", "png"),
    (b"\xff\xd8\xff", "jpg"),
)

_LIST = ", ".join(FORMATS)


def format_of(path: str | os.PathLike[str]) -> str:
    """The format by file name extension; raises OBJECT_FORMAT_UNKNOWN or OBJECT_FORMAT_UNSUPPORTED."""
    suffix = PurePath(path).suffix.lstrip(".")
    if not suffix:
        raise ObjectError(
            "OBJECT_FORMAT_UNKNOWN",
            field="format",
            message=f"The file name {PurePath(path).name!r} has no extension.",
            remedy=f"Name the format: {_LIST}.",
        )
    return check_format(suffix)


def check_format(name: str) -> str:
    """The canonical (lower-case) format name; raises OBJECT_FORMAT_UNKNOWN or OBJECT_FORMAT_UNSUPPORTED."""
    format = name.strip().lstrip(".").lower()
    if format in FORMATS:
        return format
    if format in UNSUPPORTED:
        raise _unsupported(format, field="format")
    raise ObjectError(
        "OBJECT_FORMAT_UNKNOWN",
        field="format",
        message=f"The format {name[:40]!r} is not known.",
        remedy=f"Send one of: {_LIST}.",
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
        remedy=f"Send it with the format {found!r} (or rename it to .{found}).",
    )


def sniff(data: bytes) -> str | None:
    """The format that the first bytes prove, or None when they prove nothing (OBJ, XYZ and binary STL have no mark)."""
    head = data[:1024]
    for signature, format in _SIGNATURES:
        if head.startswith(signature):
            return format
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    if text.startswith((b"OFF", b"COFF", b"NOFF", b"CNOFF")):
        return "off"
    if text.startswith(b"{"):
        return "gltf"
    if text.startswith(b"<") and b"COLLADA" in head:
        return "dae"
    if text.startswith(b"solid") and b"facet" in data[:4096]:
        return "stl"
    return None


def _unsupported(format: str, *, field: str) -> ObjectError:
    what = UNSUPPORTED[format]
    archive = "archive" in what or format == "pkl"
    convert = (
        "Unpack it and send the object file itself" if archive else "Convert it (Blender: File > Export > glTF 2.0)"
    )
    return ObjectError(
        "OBJECT_FORMAT_UNSUPPORTED",
        field=field,
        message=f"The file is {what}, which is not read here.",
        remedy=f"{convert}; formats read: {_LIST}.",
    )
