"""The child process that reads uploads: `python -m roam_goalpose.objects.worker MEMORY_BYTES [MODULE …]`, driven by
`isolation`. Modules are readers that others added to the registry: importing them registers their formats.

One request after another arrives on standard input and is answered on what was standard output, in frames (`wire`). The
process may not write files, and limits on memory and CPU time end it when a file makes a parser run away.
"""

from __future__ import annotations

import importlib
import os
import resource
import sys
import traceback
from dataclasses import replace
from typing import BinaryIO

from roam_goalpose.objects.errors import ObjectError, out_of_memory
from roam_goalpose.objects.limits import Limits
from roam_goalpose.objects.loading import load_shape
from roam_goalpose.objects.readers.registry import find
from roam_goalpose.objects.wire import READY, pack_shape, read_frame, write_frame


def main() -> None:
    """Serve requests until standard input closes."""
    requests = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    # Nothing a library prints may get between the frames, and nothing may wait for input.
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 0)
    os.dup2(nowhere, 1)
    for module in sys.argv[2:]:
        importlib.import_module(module)
    limit_process(memory_bytes=int(sys.argv[1]))
    write_frame(answers, READY, ())
    try:
        while serve_one(requests, answers):
            pass
    except MemoryError:  # before or after the reading: the request or the answer itself is too large
        write_frame(answers, {"error": out_of_memory().to_dict(), "last": True}, ())


def serve_one(requests: BinaryIO, answers: BinaryIO) -> bool:
    """Answer one request; False when the parent has gone or this process should be replaced."""
    frame = read_frame(requests)
    if frame is None:
        return False
    head, parts = frame
    limits = replace(Limits(), **head["limits"])
    limit_cpu(limits.cpu_seconds)
    fragile = find(head["format"]).fragile
    try:
        said = {name: head[name] for name in ("unit", "up", "size", "piece")}
        packed, arrays = pack_shape(load_shape(parts[0], head["format"], **said, limits=limits))
    except ObjectError as error:
        write_frame(answers, {"error": error.to_dict(), "last": fragile}, ())
        return not fragile
    except MemoryError:
        write_frame(answers, {"error": out_of_memory().to_dict(), "last": True}, ())
        return False  # what is left of the heap is not worth trusting
    except Exception:  # a fault of ours, not of the file: the parent logs it
        write_frame(answers, {"fault": traceback.format_exc()[-4000:], "last": True}, ())
        return False
    write_frame(answers, {"shape": packed, "last": fragile}, arrays)
    return not fragile


def limit_process(*, memory_bytes: int) -> None:
    """Cap address space and forbid writing files, where the system lets us (macOS refuses RLIMIT_AS)."""
    for kind, limit in ((resource.RLIMIT_AS, memory_bytes), (resource.RLIMIT_CORE, 0)):
        try:
            resource.setrlimit(kind, (limit, limit))
        except (ValueError, OSError):
            continue
    # Soft only: `readers.scratch` lifts it while it writes what was sent for a library that reads files only.
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


def limit_cpu(seconds: float) -> None:
    """Let the kernel end this process after so many more CPU seconds."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (int(used.ru_utime + used.ru_stime + seconds) + 1, hard))


if __name__ == "__main__":
    main()
