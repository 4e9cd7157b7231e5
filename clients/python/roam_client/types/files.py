"""Saving without any service: .npz for numpy, .json for everything else; a file is whole or not there."""

import contextlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from roam_client.errors import FormatError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A file to write in the place of `path`, which it becomes when the block ends: written, synced, renamed.

    When the block or the disk fails, `path` is as before and nothing else is left. It has the ending of `path`. Raises
    OSError that names `path`.
    """
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield part
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        part.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        raise OSError(error.errno, f"cannot write {path}: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


def _sync_folder(folder: Path) -> None:
    """The rename itself reaches the disk; where folders cannot be opened (Windows) the system sees to it."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def save_arrays(path: Path, arrays: dict[str, Any], extra: dict[str, Any]) -> None:
    """Writes `arrays` as .npz, or `arrays` and `extra` as .json.

    In the .npz, `extra` is one JSON text named "metadata": no reader needs pickle. FormatError for other endings,
    OSError that names the file when it cannot be written.
    """
    ending = path.suffix.lower()
    if ending not in (".npz", ".json"):
        raise FormatError(
            f"{path.name}: this client writes .npz and .json; for .glb and .bvh use the roam command, "
            "which has the services' exporters"
        )
    with whole_file(path) as part:
        if ending == ".npz":
            np.savez_compressed(part, **arrays, metadata=np.array(json.dumps(extra)))
        else:
            lists = {name: np.asarray(value).tolist() for name, value in arrays.items()}
            part.write_text(json.dumps({**lists, **extra}, allow_nan=False))
