"""Arrays on the wire: little-endian float32, or int16 scaled by 32767 for rotations (glTF normalised SHORT).

See proto/README.md for the layout byte by byte.
"""

import numpy as np

from roam_character.rotation import quat_normalize


def pack_float32(values: np.ndarray) -> bytes:
    """Any shape -> bytes, row-major little-endian float32."""
    return np.ascontiguousarray(values, "<f4").tobytes()


def unpack_float32(data: bytes, shape: tuple[int, ...]) -> np.ndarray:
    """Bytes -> float32 array of `shape` (one dimension may be -1). Raises ValueError when the size does not fit."""
    if len(data) % 4:
        raise ValueError(f"{len(data)} bytes are not a whole number of float32 values")
    return np.frombuffer(data, "<f4").reshape(shape).astype(np.float32)


def snorm16(rotations: np.ndarray) -> np.ndarray:
    """Unit quaternions [..., 4] -> int16 of the same shape."""
    return np.rint(np.clip(rotations, -1, 1) * 32767).astype(np.int16)


def pack_int16(values: np.ndarray) -> bytes:
    """Any shape of int16 -> bytes, row-major little-endian."""
    return np.ascontiguousarray(values, "<i2").tobytes()


def pack_snorm16(rotations: np.ndarray) -> bytes:
    """Unit quaternions [..., 4] -> bytes, 8 per quaternion."""
    return pack_int16(snorm16(rotations))


def unpack_snorm16(data: bytes, shape: tuple[int, ...]) -> np.ndarray:
    """Bytes -> unit quaternions float32 of `shape`, renormalised. Raises ValueError when the size does not fit."""
    if len(data) % 2:
        raise ValueError(f"{len(data)} bytes are not a whole number of int16 values")
    values = np.frombuffer(data, "<i2").reshape(shape).astype(np.float32) / 32767
    return np.asarray(quat_normalize(values), np.float32)
