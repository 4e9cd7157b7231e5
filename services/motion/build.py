"""What decides the last bits of a frame besides the session: the network, the library and the kind of processor."""

import hashlib
import platform
from pathlib import Path

import torch

_CPUINFO = Path("/proc/cpuinfo")


def build_name(weights: str) -> str:
    """Equal where frames are equal bit for bit; `weights` names the network."""
    parts = (weights, torch.__version__, platform.system(), platform.machine(), _processor())
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _processor() -> str:
    """The model, where the system tells it: libraries pick their loops by it."""
    capability = torch.backends.cpu.get_cpu_capability()
    if not _CPUINFO.exists():
        return f"{capability} {platform.processor()}"
    models = {line for line in _CPUINFO.read_text().splitlines() if line.startswith(("model name", "CPU part"))}
    return " ".join([capability, *sorted(models)])
