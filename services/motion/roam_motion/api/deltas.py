"""Rotations as differences from the frames before, as small as they are: ROTATION_ENCODING_DELTA16 (proto/README.md).

The numbers are those of SNORM16, to the bit. People turn their joints evenly: where a frame goes on as the two before
it, what is left to tell is a few bits a joint.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Shorts = npt.NDArray[np.int16]

MOST_BEFORE = 2  # frames that a difference may look back at
_WIDEST, _WHOLE = 14, 15  # bits of a joint's differences; what stands for 16 bits of the numbers themselves


def pack_deltas(rotations: Shorts, before: Sequence[Shorts]) -> bytes:
    """Rotations [J, 4] as SNORM16 has them, told after those of at most two frames `before`, the latest first."""
    if not before:
        return b"\0" + rotations.astype("<i2").tobytes()
    signed = rotations.astype(np.int32) - expected(before)
    numbers = ((signed << 1) ^ (signed >> 31)).tolist()
    widths, bits, at = 0, 0, 0
    # Whole numbers of any length: for so few, several times as quick as arrays of bits.
    for joint, row in enumerate(numbers):
        width = length = max(row).bit_length()
        if width > _WIDEST:
            width, length, row = _WHOLE, 16, (rotations[joint].astype(np.int32) & 0xFFFF).tolist()
        x, y, z, w = row
        bits |= (x | y << length | z << 2 * length | w << 3 * length) << at
        widths |= width << 4 * joint
        at += 4 * length
    head = bytes([len(before)]) + widths.to_bytes((len(numbers) + 1) // 2, "little")
    return head + bits.to_bytes((at + 7) // 8, "little")


def expected(before: Sequence[Shorts]) -> npt.NDArray[np.int32]:
    """Where rotations are that go on as the last one, or two, frames did [J, 4]."""
    latest = before[0].astype(np.int32)
    return latest if len(before) == 1 else 2 * latest - before[1]
