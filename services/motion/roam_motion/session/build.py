"""What decides the last bits of a frame besides the session: the network, the code, the library and the kind of
processor."""

import hashlib
import platform
from collections.abc import Sequence
from pathlib import Path

import roam_character
import torch

_CPUINFO = Path("/proc/cpuinfo")
_CODE = Path(__file__).parents[1], Path(roam_character.__file__).parent


def build_name(weights: str, code: Sequence[Path] = _CODE) -> str:
    """Equal where frames are equal bit for bit; `weights` names the network, `code` folders with the sources."""
    parts = (weights, _sources(code), torch.__version__, platform.system(), platform.machine(), _processor())
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _sources(folders: Sequence[Path]) -> str:
    """A step written in another way rounds otherwise, so replicas of two versions do not make the same frames."""
    files = (file for folder in folders for file in sorted(folder.rglob("*.py")))
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).hexdigest()


def _processor() -> str:
    """The model, where the system tells it: libraries pick their loops by it."""
    capability = torch.backends.cpu.get_cpu_capability()
    if not _CPUINFO.exists():
        return f"{capability} {platform.processor()}"
    models = {line for line in _CPUINFO.read_text().splitlines() if line.startswith(("model name", "CPU part"))}
    return " ".join([capability, *sorted(models)])
