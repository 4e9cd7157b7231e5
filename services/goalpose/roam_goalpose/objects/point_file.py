"""Point clouds without a library: XYZ text and NPY arrays. PCD has its own module."""

from __future__ import annotations

import io

import numpy as np

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Geometry
from roam_goalpose.objects.limits import Limits, check_counts


def read_xyz(data: bytes, limits: Limits) -> Geometry:
    """Text with one point a line: three numbers, more columns (normals, colours) are ignored.

    Separators are spaces, tabs, commas or semicolons; `#` and `//` begin comments; a first line with only the number of
    points is skipped. Coordinates stay in file units.
    """
    check_counts(data.count(b"\n"), 0, limits)
    text = data.decode("utf-8-sig", errors="replace").translate(str.maketrans(",;\t", "   "))
    first = text.lstrip().split("\n", 1)
    if len(first) == 2 and first[0].strip().isdigit():
        text = first[1]
    try:
        points = np.loadtxt(io.StringIO(text), comments=("#", "//"), usecols=(0, 1, 2), ndmin=2)
    except (ValueError, IndexError) as error:
        raise malformed("xyz", f"every line must begin with three numbers ({str(error)[:80]})") from error
    return Geometry(points.astype(np.float64), None)


def read_npy(data: bytes, limits: Limits) -> Geometry:
    """A NumPy array `[N, 3]` or wider (first three columns), any real number type; pickled objects are refused."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[
            version
        ]
        shape, fortran, dtype = read_header(stream)
    except Exception as error:  # numpy hands the text to Python's parser, which fails in many ways
        raise malformed("npy", f"its header is not valid ({str(error)[:80]})") from error
    if dtype.hasobject:
        raise ObjectError(
            "OBJECT_MALFORMED",
            field="content",
            message="The NPY file holds pickled Python objects, which are never loaded.",
            remedy="Save a plain array of floats: numpy.save(file, points.astype('float32')).",
        )
    if dtype.kind not in "fiu" or len(shape) != 2 or shape[0] < 0 or shape[1] < 3:
        raise malformed("npy", f"the array must be [N, 3] of numbers, not {shape} of {dtype}")
    check_counts(shape[0], 0, limits)
    body = data[stream.tell() :]
    if shape[0] * shape[1] * dtype.itemsize > len(body):
        raise malformed("npy", f"it is cut off: {shape[0]} points are promised, {len(body)} bytes are there")
    flat = np.frombuffer(body, dtype=dtype, count=shape[0] * shape[1])
    points = flat.reshape(shape[::-1]).T if fortran else flat.reshape(shape)
    return Geometry(points[:, :3].astype(np.float64), None)
