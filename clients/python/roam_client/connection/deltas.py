"""Rotations that are told as differences from the frames before: ROTATION_ENCODING_DELTA16 (proto/README.md)."""

import numpy as np
import numpy.typing as npt

from roam_client.errors import WireError

_WHOLE = 15  # a width that stands for 16 bits of the number itself
_BITS = np.arange(16)


class DeltaReader:
    """Reads the frames of one stream, every one of them, in order; a stream that is opened anew needs a new reader."""

    def __init__(self, joint_count: int) -> None:
        self._joints = joint_count
        self._before: list[npt.NDArray[np.int32]] = []  # the latest first, two at most

    def read(self, data: bytes) -> bytes:
        """The same rotations as SNORM16. WireError when the bytes are cut short, or tell of frames never received."""
        looks_back = data[0] if data else -1
        if looks_back == 0:
            if len(data) != 1 + 8 * self._joints:
                raise WireError(f"rotations has {len(data)} bytes, which is not delta16 of {self._joints} joints")
            found = np.frombuffer(data, "<i2", offset=1).reshape(-1, 4).astype(np.int32)
        elif looks_back in (1, 2) and looks_back <= len(self._before):
            found = self._after(data[1:], looks_back)
        else:
            raise WireError("rotations are told as differences from frames that this stream did not bring")
        self._before = [found, *self._before[:1]]
        return found.astype("<i2").tobytes()

    def _after(self, data: bytes, looks_back: int) -> npt.NDArray[np.int32]:
        head = (self._joints + 1) // 2
        packed = np.frombuffer(data, np.uint8)
        widths = np.stack([packed[:head] & 15, packed[:head] >> 4], 1).ravel()[: self._joints].astype(int)
        whole = widths == _WHOLE
        told = np.broadcast_to(np.where(whole, 16, widths)[:, None, None] > _BITS, (len(widths), 4, 16))
        bits = np.unpackbits(packed[head:], bitorder="little")
        if len(widths) != self._joints or len(packed) - head != (told.sum() + 7) // 8:
            raise WireError(f"rotations has {1 + len(data)} bytes, which is not delta16 of {self._joints} joints")
        spread = np.zeros(told.shape, np.int32)
        spread[told] = bits[: told.sum()]
        numbers = (spread << _BITS).sum(-1, dtype=np.int32)
        latest = self._before[0]
        expected = latest if looks_back == 1 else 2 * latest - self._before[1]
        differences = (numbers >> 1) ^ -(numbers & 1)
        signed = numbers.astype(np.uint16).view(np.int16).astype(np.int32)
        found: npt.NDArray[np.int32] = np.where(whole[:, None], signed, expected + differences)
        return found
