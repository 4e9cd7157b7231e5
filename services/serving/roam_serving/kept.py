"""Values that are costly to compute and the same in every process of one build: kept as files between processes.

They lie in the user's cache folder, under a mark of the code that made them, so that another build never reads them. A
folder that cannot be written or belongs to somebody else is not used: then everything is computed, as the first time.
"""

import hashlib
import os
import pickle
import platform
import shutil
import tempfile
from collections.abc import Iterable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

FOLDER = "ROAM_CACHE"  # environment variable: where files are kept; empty: nowhere
_BUILDS = 4  # whose files stay; those of older ones go when a new one begins
_SOURCES = (".py", ".json", ".npz")


def cache_folder() -> Path | None:
    """Where this user's files are kept; None when nowhere."""
    named = os.environ.get(FOLDER)
    if named is not None:
        return Path(named) if named else None
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "roam"


def build_mark(packages: Iterable[str], libraries: Iterable[str]) -> str:
    """A hash of everything that may change a bit: the packages' files, the libraries' versions, the machine's kind."""
    digest = hashlib.sha256(f"{platform.python_version()} {platform.machine()} {_processor()}".encode())
    for library in libraries:
        digest.update(f"{library} {version(library)}".encode())
    for package in packages:
        spec = find_spec(package)
        for folder in (spec and spec.submodule_search_locations) or ():
            for file in sorted(Path(folder).rglob("*")):
                if file.suffix in _SOURCES:
                    digest.update(str(file.relative_to(folder)).encode())
                    digest.update(file.read_bytes())
    return digest.hexdigest()[:32]


def _processor() -> str:
    """What the processor can do: products round otherwise where it can do more."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line for line in lines if line.startswith(("flags", "Features"))), "")


class KeptValues:
    """Values of one build by a key; what cannot be read or written counts as not there."""

    def __init__(self, name: str, build: str, folder: Path | None) -> None:
        self._folder = None if folder is None else _own(folder / name, build)

    def get(self, key: str) -> Any:
        """The value, or None."""
        if self._folder is None:
            return None
        try:
            return pickle.loads(self._path(key).read_bytes())
        except (OSError, pickle.UnpicklingError, EOFError, AttributeError, ImportError, IndexError, ValueError):
            return None

    def put(self, key: str, value: Any) -> None:
        """Writes it; another process sees all of it or nothing."""
        if self._folder is None:
            return
        try:
            with tempfile.NamedTemporaryFile(dir=self._folder, delete=False) as file:
                file.write(pickle.dumps(value, pickle.HIGHEST_PROTOCOL))
            Path(file.name).replace(self._path(key))
        except OSError:
            self._folder = None  # full, or gone: no use to try again

    def _path(self, key: str) -> Path:
        assert self._folder is not None
        return self._folder / hashlib.sha256(key.encode()).hexdigest()[:40]


def _own(folder: Path, build: str) -> Path | None:
    """The build's folder, made if need be; None when others could write there: what is read is trusted like code."""
    ours = folder / build
    try:
        if not ours.is_dir():
            ours.mkdir(mode=0o700, parents=True, exist_ok=True)
            _forget_old(folder, ours)
        private = all(_private(part) for part in (folder, ours))
    except OSError:
        return None
    return ours if private else None


def _private(folder: Path) -> bool:
    if not hasattr(os, "getuid"):
        return True  # the user's profile folder has rights of its own
    found = folder.stat()
    return found.st_uid == os.getuid() and not found.st_mode & 0o022


def _forget_old(folder: Path, ours: Path) -> None:
    others = sorted((one for one in folder.iterdir() if one != ours), key=lambda one: one.stat().st_mtime)
    for one in others[: max(0, len(others) + 1 - _BUILDS)]:
        shutil.rmtree(one, ignore_errors=True)
