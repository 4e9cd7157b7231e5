"""Reading a character's file: one entry a format, in `RIG_READERS`.

FBX and USD are read by foreign libraries in a child process with a time and a memory limit: whatever a file does to
them ends as a sentence.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from roam_character.documents.gltf_document import GltfDocument, GltfError
from roam_character.rigs.bvh_rig import read_bvh_rig
from roam_character.rigs.rig import Rig, RigError, rig_of_document

LARGEST = 512 * 2**20  # [bytes] of a character's file
_SECONDS, _MEMORY = 120, 4 * 2**30


def read_gltf_rig(path: Path) -> Rig:
    """GLB, glTF (with its buffers beside it) and VRM 0.x / 1.0. Raises RigError."""
    try:
        document = GltfDocument.read(path.read_bytes(), folder=path.parent)
    except GltfError as error:
        raise RigError(f"{path.name}: {error}", remedy="Export it again as GLB.") from error
    return rig_of_document(document, name=path.name, format=path.suffix.lower()[1:])


def _read_by_child(module: str, library: str) -> Callable[[Path], Rig]:
    def read(path: Path) -> Rig:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "rig.glb"
            command = [sys.executable, "-m", f"roam_character.rigs.{module}", str(path.resolve()), str(out)]
            try:
                done = subprocess.run(
                    command, capture_output=True, timeout=_SECONDS, cwd=folder, preexec_fn=_limit, env=_environment()
                )
            except subprocess.TimeoutExpired as error:
                raise RigError(f"{path.name} took longer than {_SECONDS} s to read", remedy=_AS_GLB) from error
            if done.returncode != 0 or not out.is_file():
                raise _failure(path, library, done)
            document = GltfDocument.read(out.read_bytes())
        return rig_of_document(document, name=path.name, format=path.suffix.lower()[1:], notes=_LOST[module])

    return read


_AS_GLB = "Save it as GLB or VRM (Blender: File > Import, then Export > glTF)."
_LOST = {
    "fbx_document": ("of the FBX: skeleton, skinned meshes, normals, texture coordinates and plain colours are kept; "
                     "textures, blend shapes and its own animations are not",),
    "usd_document": ("of the USD: the first skeleton and the meshes bound to it are kept with plain colours; "
                     "textures, other prims and its own animation are not",),
}  # fmt: skip


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "OMP_NUM_THREADS": "1"}


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _failure(path: Path, library: str, done: subprocess.CompletedProcess[bytes]) -> RigError:
    try:
        reason = json.loads(done.stdout)["error"]
    except (ValueError, KeyError):
        reason = f"{library} could not read it (it ended with status {done.returncode})"
    if "No module named" in reason:
        return RigError(f"{path.name}: reading it needs {library}", remedy=f"pip install {library}, or: {_AS_GLB}")
    return RigError(f"{path.name} cannot be read: {reason}", remedy=_AS_GLB)


_FBX, _USD = _read_by_child("fbx_document", "ufbx"), _read_by_child("usd_document", "usd-core")
RIG_READERS: dict[str, Callable[[Path], Rig]] = {
    ".glb": read_gltf_rig, ".gltf": read_gltf_rig, ".vrm": read_gltf_rig, ".fbx": _FBX, ".bvh": read_bvh_rig,
    ".usd": _USD, ".usda": _USD, ".usdc": _USD, ".usdz": _USD,
}  # fmt: skip


def read_rig(path: str | Path) -> Rig:
    """A character from its file. Raises RigError with a remedy for what cannot be read."""
    path = Path(path)
    if not path.is_file():
        raise RigError(f"there is no file {path}", remedy="Check the path.")
    reader = RIG_READERS.get(path.suffix.lower())
    if reader is None:
        raise RigError(f"{path.name}: its ending says no known character format", remedy=f"Read are: {known_endings()}")
    if path.stat().st_size > LARGEST:
        raise RigError(f"{path.name} is larger than {LARGEST // 2**20} MiB", remedy="Export it with smaller textures.")
    return reader(path)


def known_endings() -> str:
    """The endings that are read, for messages and help."""
    return ", ".join(ending[1:] for ending in RIG_READERS)
