import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from roam.v1 import motion_pb2
from roam_client import WireError
from roam_client.connection.packing import pack_floats, pack_rotations, unpack_bits, unpack_floats, unpack_rotations

SNORM16 = motion_pb2.ROTATION_ENCODING_SNORM16


def test_floats_survive_and_are_little_endian():
    values = np.arange(6, dtype=np.float32).reshape(2, 3)
    data = pack_floats(values)
    assert data[4:8] == b"\x00\x00\x80\x3f"
    np.testing.assert_array_equal(unpack_floats(data, (2, 3), field="x"), values)
    np.testing.assert_array_equal(unpack_floats(data, (-1, 3), field="x"), values)


@pytest.mark.parametrize(("size", "shape"), [(23, (2, 3)), (20, (2, 3)), (20, (-1, 3)), (28, (2, 3))])
def test_bytes_that_do_not_fit_are_named(size, shape):
    with pytest.raises(WireError, match="root has"):
        unpack_floats(bytes(size), shape, field="root")


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_snorm16_is_off_by_less_than_a_hundredth_of_a_degree(values):
    rotation = np.array([values]) / np.linalg.norm(values)
    read = unpack_rotations(pack_rotations(rotation, SNORM16), 1, SNORM16)
    assert np.linalg.norm(read) == pytest.approx(1, abs=1e-6)
    chord = min(np.linalg.norm(read - rotation), np.linalg.norm(read + rotation))
    assert np.degrees(2 * chord) < 0.01


def test_rotations_of_the_wrong_size_or_of_an_unknown_encoding_are_refused():
    with pytest.raises(WireError, match="snorm16"):
        unpack_rotations(bytes(15), 2, SNORM16)
    with pytest.raises(WireError, match="newer"):
        unpack_rotations(bytes(16), 1, 9)


def test_bits_count_from_the_lowest():
    assert unpack_bits(0b0101, 4).tolist() == [True, False, True, False]
