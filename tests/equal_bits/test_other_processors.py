"""All tests of equal bits again, with the kernels that libraries pick on other processors.

Which kernels torch, MKL and oneDNN use is settled when a process starts, so each kind has a process of its own.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

TESTS = Path(__file__).parents[1]
FILES = ("motion/test_equal_bits.py", "character/test_elementary.py", "goalpose/poses/test_sharing.py")
KINDS = [
    {"ATEN_CPU_CAPABILITY": "default", "MKL_ENABLE_INSTRUCTIONS": "SSE4_2", "ONEDNN_MAX_CPU_ISA": "SSE41"},
    {"ATEN_CPU_CAPABILITY": "avx2", "MKL_ENABLE_INSTRUCTIONS": "AVX2", "ONEDNN_MAX_CPU_ISA": "AVX2"},
    {"ATEN_CPU_CAPABILITY": "avx512", "MKL_CBWR": "AVX512", "ONEDNN_MAX_CPU_ISA": "AVX512_CORE"},
    {"MKL_CBWR": "COMPATIBLE", "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"},
    {"MKL_CBWR": "AVX2"},
]
WIDTHS = ("DEFAULT", "AVX2", "AVX512")  # of vectors, in torch's words


@pytest.mark.parametrize("kernels", KINDS, ids=lambda kind: " ".join(f"{key}={value}" for key, value in kind.items()))
def test_bits_are_equal_with_the_kernels_of_other_processors(kernels):
    here = torch.backends.cpu.get_cpu_capability()
    wanted = kernels.get("ATEN_CPU_CAPABILITY", "default").upper()
    if here not in WIDTHS or WIDTHS.index(wanted) > WIDTHS.index(here):
        pytest.skip(f"this processor ({here}) has no {wanted}")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "equal_bits"]
    command += [str(TESTS / name) for name in FILES]
    done = subprocess.run(command, env=os.environ | kernels, capture_output=True, text=True, check=False, timeout=280)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-2000:]
