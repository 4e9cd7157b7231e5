"""Point clouds without a library: text (XYZ, PTS, CSV) and NPY arrays. PCD has its own module."""

from __future__ import annotations

import io
import itertools
import re
from collections.abc import Mapping, Sequence

import numpy as np

from roam_goalpose.objects.errors import ObjectError, malformed
from roam_goalpose.objects.geometry import Array, Geometry
from roam_goalpose.objects.limits import Limits, check_points

_HEADER_LINES = 40  # that are looked at for the first point
_COLUMN_NAMES: Mapping[str, Sequence[str]] = {
    axis: (axis, f"{axis}coord", f"{axis}_coord", f"pos_{axis}", f"position_{axis}", f"points:{number}", f"p{axis}",
           f"//{axis}", f"#{axis}", f"cartesian{axis}", f"{axis}[m]", f"{axis}(m)")
    for number, axis in enumerate("xyz")
}  # fmt: skip
_DECIMAL_COMMA = re.compile(r"^\s*-?\d+,\d+\s*[;\t ]\s*-?\d+,\d+\s*[;\t ]\s*-?\d+,\d+")
_TABLE = str.maketrans(",;\t|", "    ")
_COMMENTS = ("#", "//")


def read_xyz(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """Text with one point a line: three numbers, more columns (normals, colours, intensities) are ignored.

    Separators are spaces, tabs, commas, semicolons or bars; `#` and `//` begin comments. Lines before the first point
    are skipped: column names (obeyed when they name x, y and z) and counts of points. Coordinates stay in file units.
    """
    check_points(data.count(b"\n"), limits)
    if b"\0" in data[:4096]:
        raise malformed("xyz", "it is binary; XYZ is text")
    text = data.decode("utf-8-sig", errors="replace")
    if "\n" not in text:
        text = text.replace("\r", "\n")
    skip, columns, commas = _layout(text)
    if skip:
        text = text.split("\n", skip)[-1]
    text = text.replace(",", ".").translate(_TABLE) if commas else text.translate(_TABLE)
    try:
        points = np.loadtxt(io.StringIO(text), comments=_COMMENTS, usecols=columns, ndmin=2)
    except (ValueError, IndexError):
        points = _line_by_line(text, columns)
    return Geometry(points.astype(np.float64).reshape(-1, 3), None)


def _layout(text: str) -> tuple[int, tuple[int, int, int], bool]:
    """Lines before the first point, the columns of x, y, z, and whether commas stand for decimal points."""
    columns = (0, 1, 2)
    for number, line in enumerate(itertools.islice(io.StringIO(text), _HEADER_LINES)):
        commas = bool(_DECIMAL_COMMA.match(line)) and (";" in line or line.count(",") == len(line.split()))
        words = (line.replace(",", ".") if commas else line).translate(_TABLE).split()
        if line.lstrip().startswith(_COMMENTS):
            columns = _named_columns(words) or columns
        elif len(words) > max(columns) and all(_is_number(words[column]) for column in columns):
            return number, columns, commas
        elif not (len(words) == 1 and words[0].isdigit()):
            columns = _named_columns(words) or columns
    raise malformed("xyz", f"none of its first {_HEADER_LINES} lines begins with three numbers")


def _named_columns(words: Sequence[str]) -> tuple[int, int, int] | None:
    plain = [word.strip("\"'").lower() for word in words]
    if plain and plain[0] in ("#", "//"):
        plain = plain[1:]
    found = [next((plain.index(name) for name in _COLUMN_NAMES[axis] if name in plain), -1) for axis in "xyz"]
    return (found[0], found[1], found[2]) if min(found) >= 0 else None


def _line_by_line(text: str, columns: tuple[int, int, int]) -> Array:
    """Lines that hold no point between those that do: counts of further scans in PTS, a footer."""
    rows, other = [], 0
    for line in text.split("\n"):
        words = line.split()
        if not words or words[0].startswith(_COMMENTS):
            continue
        if len(words) > max(columns) and all(_is_number(words[column]) for column in columns):
            rows.append([words[column] for column in columns])
        elif not (len(words) == 1 and words[0].isdigit()):
            other += 1
    if not rows or other > 0.01 * len(rows) + 2:
        raise malformed("xyz", f"every line must begin with three numbers; {other} lines do not")
    return np.array(rows, "S32").astype(np.float64)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return "_" not in word


def read_npy(data: bytes, limits: Limits, companions: Mapping[str, bytes]) -> Geometry:
    """A NumPy array `[N, 3]` or wider (first three columns), any real number type; pickled objects are refused."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[
            version
        ]
        shape, fortran, dtype = read_header(stream)
    except Exception as error:  # numpy hands the text to Python's parser, which fails in many ways
        raise malformed("npy", "its header is not valid") from error
    if dtype.hasobject:
        raise ObjectError(
            "OBJECT_MALFORMED",
            field="content",
            message="The NPY file holds pickled Python objects, which are never loaded.",
            remedy="Save a plain array of floats: numpy.save(file, points.astype('float32')).",
        )
    if len(shape) == 3 and shape[2] >= 3 and min(shape) >= 0 and not fortran:
        shape = (shape[0] * shape[1], shape[2])  # an organised scan: rows and columns of an image
    if dtype.kind not in "fiu" or len(shape) != 2 or shape[0] < 0 or shape[1] < 3:
        raise malformed("npy", f"the array must be [N, 3] of numbers, not {shape} of {dtype}")
    check_points(shape[0], limits)
    body = data[stream.tell() :]
    if shape[0] * shape[1] * dtype.itemsize > len(body):
        raise malformed("npy", f"it is cut off: {shape[0]} points are promised, {len(body)} bytes are there")
    flat = np.frombuffer(body, dtype=dtype, count=shape[0] * shape[1])
    points = flat.reshape(shape[::-1]).T if fortran else flat.reshape(shape)
    return Geometry(points[:, :3].astype(np.float64), None)
