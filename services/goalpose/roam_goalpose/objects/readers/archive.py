"""ZIP archives: one object and the files that it refers to. Nothing is ever unpacked to disk."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import PurePosixPath

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Geometry
from roam_goalpose.objects.limits import Limits
from roam_goalpose.objects.readers.registry import FORMATS, check_content, check_format, find

_MAX_FILES = 2_000
_UNPACKED = 4  # times the bytes that a plain file may have
# Never read: they cost memory and say nothing about the shape.
_LOOKS = {"png", "jpg", "jpeg", "webp", "tga", "tif", "tiff", "bmp", "dds", "ktx", "ktx2", "exr", "hdr", "gif", "mtl"}
# Which file of a name with several endings is meant: the one that says most.
_PREFERRED = (
    "glb",
    "gltf",
    "usdz",
    "usd",
    "fbx",
    "3mf",
    "dae",
    "obj",
    "ply",
    "stl",
    "off",
    "e57",
    "las",
    "pcd",
    "npy",
    "xyz",
)


def read_zip(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """The one object in an archive; raises ObjectError."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            files = _files(archive, limits)
            name, format = _object_in(list(files))
            unpacked = _unpack(archive, files, limits)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError, ValueError) as error:
        if isinstance(error, ObjectError):
            raise
        encrypted = "encrypted" in str(error) or "password" in str(error)
        raise malformed(
            "zip", "it is encrypted" if encrypted else "it is damaged or packed in an uncommon way"
        ) from error
    folder = PurePosixPath(name).parent
    beside = {_relative(path, folder): content for path, content in unpacked.items() if path != name}
    check_content(unpacked[name], format)
    return find(format).load()(unpacked[name], limits, beside)


def _files(archive: zipfile.ZipFile, limits: Limits) -> dict[str, zipfile.ZipInfo]:
    entries = archive.infolist()
    if len(entries) > _MAX_FILES:
        raise malformed("zip", f"it holds {len(entries)} files; at most {_MAX_FILES} are looked at")
    kept = {}
    for entry in entries:
        path = PurePosixPath(entry.filename.replace("\\", "/"))
        hidden = any(part.startswith((".", "__MACOSX")) for part in path.parts)
        is_file = entry.filename and not entry.filename.endswith("/")  # a damaged name can be empty
        if is_file and not hidden and path.suffix.lstrip(".").lower() not in _LOOKS:
            kept[str(path)] = entry
    if sum(entry.file_size for entry in kept.values()) > _UNPACKED * limits.bytes:
        raise ObjectError(
            "OBJECT_TOO_LARGE",
            field="content",
            message=f"The ZIP unpacks to more than {_UNPACKED * limits.bytes} bytes.",
            remedy="Leave out what does not belong to the object, or simplify it: 20,000 triangles are plenty.",
        )
    return kept


def _unpack(archive: zipfile.ZipFile, files: Mapping[str, zipfile.ZipInfo], limits: Limits) -> dict[str, bytes]:
    """Contents by path; an entry that is longer than it says is cut there."""
    unpacked, left = {}, _UNPACKED * limits.bytes
    for path, entry in files.items():
        with archive.open(entry) as stream:
            unpacked[path] = stream.read(min(entry.file_size, left) + 1)
        left -= len(unpacked[path])
        if len(unpacked[path]) > entry.file_size or left < 0:
            raise malformed("zip", "a file in it is longer than it says")
    return unpacked


def _object_in(paths: list[str]) -> tuple[str, str]:
    """Path and format of the object that is meant."""
    found: dict[str, list[tuple[str, str]]] = {}
    for path in paths:
        format = _format(path)
        if format:
            found.setdefault(str(PurePosixPath(path).with_suffix("")).lower(), []).append((path, format))
    named = [
        min(same, key=lambda one: _PREFERRED.index(one[1]) if one[1] in _PREFERRED else 99) for same in found.values()
    ]
    meshes = [one for one in named if one[1] not in ("xyz", "npy")]  # a read-me is no cloud
    chosen = meshes or named
    if len(chosen) == 1:
        return chosen[0]
    if not chosen:
        names = ", ".join(paths[:5]) or "nothing"
        message, remedy = f"The ZIP holds no object file, but {names}.", f"Put one object in it: {', '.join(FORMATS)}."
        raise ObjectError("OBJECT_EMPTY", field="content", message=message, remedy=remedy)
    names = ", ".join(path for path, _ in chosen[:8])
    raise ObjectError(
        "OBJECT_MALFORMED",
        field="content",
        message=f"The ZIP holds {len(chosen)} objects: {names}.",
        remedy="Send one object in a ZIP; a set belongs into one scene file, of which a piece can be chosen.",
    )


def _format(path: str) -> str | None:
    suffix = PurePosixPath(path).suffix
    if not suffix or suffix.lower() in (".zip", ".txt", ".csv", ".asc"):
        return None
    try:
        return check_format(suffix)
    except ObjectError:
        return None


def _relative(path: str, folder: PurePosixPath) -> str:
    whole = PurePosixPath(path)
    return str(whole.relative_to(folder)) if whole.is_relative_to(folder) else str(whole)
