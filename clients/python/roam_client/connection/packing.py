"""Arrays as they travel: little-endian float32, or rotations as snorm16 (glTF's normalised SHORT)."""

from collections.abc import Sequence
from math import prod

import numpy as np
import numpy.typing as npt
from roam.v1 import motion_pb2

from roam_client.errors import WireError

Floats = npt.NDArray[np.float32]

_SNORM_SCALE = 32767.0


def unpack_floats(data: bytes, shape: Sequence[int], *, field: str) -> Floats:
    """float32 bytes -> array of `shape`; one axis may be -1. WireError when the length does not fit."""
    known = prod(n for n in shape if n != -1) * 4
    if len(data) % 4 or (len(data) != known if -1 not in shape else known == 0 or len(data) % known):
        raise WireError(f"{field} has {len(data)} bytes, which is not float32 of shape {list(shape)}")
    return np.frombuffer(data, "<f4").reshape(shape).astype(np.float32)


def pack_floats(values: npt.ArrayLike) -> bytes:
    """Array -> little-endian float32 bytes, row-major."""
    return np.ascontiguousarray(values, "<f4").tobytes()


def unpack_rotations(data: bytes, joint_count: int, encoding: int) -> Floats:
    """Packed local rotations -> unit quaternions xyzw [J, 4]. WireError when length or encoding does not fit."""
    if encoding in (motion_pb2.ROTATION_ENCODING_UNSPECIFIED, motion_pb2.ROTATION_ENCODING_FLOAT32):
        return unpack_floats(data, (joint_count, 4), field="rotations")
    if encoding != motion_pb2.ROTATION_ENCODING_SNORM16:
        raise WireError(f"rotation encoding {encoding} is newer than this client; update roam-client")
    if len(data) != joint_count * 8:
        raise WireError(f"rotations has {len(data)} bytes, which is not snorm16 of shape [{joint_count}, 4]")
    rotations = np.frombuffer(data, "<i2").reshape(joint_count, 4).astype(np.float32) / _SNORM_SCALE
    # 16 bits leave a length error of about 1e-5; downstream maths expects unit quaternions.
    return np.asarray(rotations / np.linalg.norm(rotations, axis=-1, keepdims=True), np.float32)


def pack_rotations(rotations: npt.ArrayLike, encoding: int) -> bytes:
    """Unit quaternions [J, 4] -> bytes in one of the encodings."""
    if encoding == motion_pb2.ROTATION_ENCODING_SNORM16:
        return np.rint(np.asarray(rotations, np.float64) * _SNORM_SCALE).astype("<i2").tobytes()
    return pack_floats(rotations)


def unpack_bits(bits: int, count: int) -> npt.NDArray[np.bool_]:
    """The lowest `count` bits, bit 0 first -> [count] bool."""
    return (bits >> np.arange(count)) & 1 == 1
