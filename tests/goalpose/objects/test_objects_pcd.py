import struct

import numpy as np
import pytest
from roam_goalpose.objects import ObjectError, load_shape
from roam_goalpose.objects.limits import Limits
from roam_goalpose.objects.readers.pcd import lzf_decompress, read_pcd

POINTS = np.random.default_rng(0).uniform(0, 1, (300, 3)).astype("<f4")


def _header(data, *, fields="x y z", size="4 4 4", kind="F F F", count="1 1 1", points=300):
    return (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {fields}\nSIZE {size}\nTYPE {kind}\nCOUNT {count}\nWIDTH {points}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {data}\n"
    ).encode()


def _lzf_literals(data):
    """Valid LZF without any back reference."""
    return b"".join(bytes([len(data[i : i + 32]) - 1]) + data[i : i + 32] for i in range(0, len(data), 32))


def _compressed(records, packed=None):
    columns = b"".join(np.ascontiguousarray(records[name]).tobytes() for name in records.dtype.names)
    body = packed if packed is not None else _lzf_literals(columns)
    return struct.pack("<II", len(body), len(columns)) + body


def test_ascii():
    rows = "\n".join(" ".join(str(v) for v in row) for row in POINTS).encode()
    np.testing.assert_allclose(read_pcd(_header("ascii") + rows, Limits(), {}).vertices, POINTS, rtol=1e-6)


def test_binary():
    np.testing.assert_array_equal(read_pcd(_header("binary") + POINTS.tobytes(), Limits(), {}).vertices, POINTS)


def test_other_fields_padding_and_field_order():
    layout = [("rgb", "<u4"), ("z", "<f8"), ("histogram", "<f4", (5,)), ("_", "u1"), ("x", "<f4"), ("y", "<f4")]
    records = np.zeros(300, dtype=layout)
    for axis, column in zip("xyz", POINTS.T, strict=True):
        records[axis] = column
    options = {"fields": "rgb z histogram _ x y", "size": "4 8 4 1 4 4", "kind": "U F F U F F", "count": "1 1 5 1 1 1"}
    data = _header("binary", **options) + records.tobytes()
    np.testing.assert_array_equal(read_pcd(data, Limits(), {}).vertices, POINTS)
    data = _header("binary_compressed", **options) + _compressed(records)
    np.testing.assert_array_equal(read_pcd(data, Limits(), {}).vertices, POINTS)


def test_missing_returns_are_marked_and_left_out():
    holed = POINTS.copy()
    holed[10] = np.nan
    read = read_pcd(_header("binary") + holed.tobytes(), Limits(), {}).vertices
    assert np.isfinite(read).all(axis=1).sum() == 299
    assert len(load_shape(_header("binary") + holed.tobytes(), "pcd").points) > 0


@pytest.mark.parametrize(
    ("packed", "plain"),
    [
        (b"\x02abc", b"abc"),
        (b"\x02abc\x20\x02", b"abcabc"),  # 3 bytes from 3 back
        (b"\x00a\x60\x00", b"a" * 6),  # overlapping: 5 bytes from 1 back
        (b"\x00a\xe0\x64\x00", b"a" * 110),  # long: 7 + 100 + 2 bytes
    ],
)
def test_lzf_back_references(packed, plain):
    assert lzf_decompress(packed, len(plain)) == plain


@pytest.mark.parametrize("packed", [b"\x05ab", b"\x00a\x20", b"\x20\x05", b"\x02abc\x02abc", b"\xff\xff\xff"])
def test_damaged_lzf_is_refused(packed):
    with pytest.raises(ObjectError) as caught:
        lzf_decompress(packed, 3)
    assert caught.value.reason == "OBJECT_MALFORMED"


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"# .PCD v0.7\n" + b"x" * 100_000, "OBJECT_MALFORMED"),
        (b"VERSION 0.7\nDATA ascii\n", "OBJECT_MALFORMED"),
        (_header("zstd"), "OBJECT_MALFORMED"),
        (_header("binary", fields="a b c") + POINTS.tobytes(), "OBJECT_MALFORMED"),
        (_header("binary", kind="Q F F") + POINTS.tobytes(), "OBJECT_MALFORMED"),
        (_header("binary", count="1 1 99999999") + POINTS.tobytes(), "OBJECT_MALFORMED"),
        (_header("binary", points=-5) + POINTS.tobytes(), "OBJECT_MALFORMED"),
        (_header("binary", points=301) + POINTS.tobytes(), "OBJECT_MALFORMED"),
        (_header("ascii") + b"1 2 3\n4 5\n", "OBJECT_MALFORMED"),
        (_header("ascii") + b"1 2 3\n", "OBJECT_MALFORMED"),
        (_header("binary_compressed") + b"\x01", "OBJECT_MALFORMED"),
        (_header("binary_compressed") + struct.pack("<II", 4, 3600) + b"\x00", "OBJECT_MALFORMED"),
        (_header("binary", points=10**9) + POINTS.tobytes(), "OBJECT_TOO_COMPLEX"),
    ],
)
def test_broken_files_are_refused(data, reason):
    with pytest.raises(ObjectError) as caught:
        read_pcd(data, Limits(), {})
    assert caught.value.reason == reason
