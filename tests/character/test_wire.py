"""Packed arrays come back as they went, to the precision that the format states."""

import numpy as np
import pytest
from roam_character import wire
from scipy.spatial.transform import Rotation

Q = Rotation.random(500, random_state=4).as_quat().astype(np.float32)


def test_float32_is_exact():
    assert np.array_equal(wire.unpack_float32(wire.pack_float32(Q), (500, 4)), Q)


def test_snorm16_is_within_a_hundredth_of_a_degree():
    packed = wire.pack_snorm16(Q)
    assert len(packed) == 8 * 500
    back = Rotation.from_quat(wire.unpack_snorm16(packed, (-1, 4)))
    error = np.degrees((back * Rotation.from_quat(Q).inv()).magnitude())
    assert error.max() < 0.01


@pytest.mark.parametrize("unpack", [wire.unpack_float32, wire.unpack_snorm16])
def test_cut_off_bytes_are_refused(unpack):
    with pytest.raises(ValueError, match=r"bytes are not|reshape"):
        unpack(b"\x00" * 15, (-1, 4))
