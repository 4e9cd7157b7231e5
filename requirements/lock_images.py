"""Writes requirements/images.txt from what `uv pip compile` prints: `python requirements/lock_images.py < compiled`.

Torch is left out (its wheel comes from an index of one's own choice, for the processor only), and so is what only its
CUDA build needs.
"""

import re
import sys
from pathlib import Path

_CUDA = re.compile(r"(nvidia|cuda|triton)\b")
_HEAD = "# What the images install besides torch, each file by its hash, for any processor. Written by scripts/lock.\n"


def without_cuda(compiled: str) -> str:
    """The requirements that are not torch's own; each with the lines of its hashes."""
    entries = re.split(r"^(?=\S)", compiled, flags=re.MULTILINE)
    return "".join(entry for entry in entries if not _CUDA.match(entry))


if __name__ == "__main__":
    Path("requirements/images.txt").write_text(_HEAD + without_cuda(sys.stdin.read()))
