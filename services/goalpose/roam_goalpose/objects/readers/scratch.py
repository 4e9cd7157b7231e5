"""A file on disk for libraries that read nothing else, in a process that may not write files otherwise."""

from __future__ import annotations

import resource
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

_LEAST = 4096  # bytes


@contextmanager
def scratch_file(data: bytes, suffix: str) -> Iterator[Path]:
    """`data` in a file of its own until the block ends."""
    with scratch_folder({f"upload{suffix}": data}) as folder:
        yield folder / f"upload{suffix}"


@contextmanager
def scratch_folder(files: Mapping[str, bytes]) -> Iterator[Path]:
    """A private folder with `files` (paths without `..`) until the block ends.

    The reading process's limit on file sizes is lifted while we write what was sent, and for nothing else.
    """
    with _writing(_LEAST):  # Python writes a byte to find out where it may
        temporary = tempfile.TemporaryDirectory(prefix="roam-upload-")
    with temporary as name:
        folder = Path(name)
        with _writing(max((len(content) for content in files.values()), default=0)):
            for path, content in files.items():
                target = folder / path
                if not target.resolve().is_relative_to(folder.resolve()):
                    raise ValueError("a path leads out of the folder")
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
        yield folder


@contextmanager
def _writing(size: int) -> Iterator[None]:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size if hard == resource.RLIM_INFINITY else min(size, hard), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
