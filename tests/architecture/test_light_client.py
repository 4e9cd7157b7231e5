"""The client and the command must start without torch: a game developer installs megabytes, not gigabytes."""

import subprocess
import sys

import pytest

OWN = ("roam_character", "roam_goalpose", "roam_motion", "roam_serving", "roam_evaluation")
HEAVY = ("torch", "scipy", "trimesh", "fastapi", "uvicorn", *OWN)


@pytest.mark.parametrize("module", ["roam_client", "roam_command"])
def test_importing_it_loads_nothing_heavy(module: str) -> None:
    code = f"import sys, {module}; print(*[name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.split() == []
