"""Broken files end in an ObjectError, never in another exception: mutations of valid files, format by format.

ROAM_FUZZ_EXAMPLES=100000 asks that often for every format, at random; by default a few that are the same every time.
"""

import contextlib
import io
import os
import struct
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from box_furniture import box_chair
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from new_formats import dae, e57, fbx, las, threemf, usda, usdz
from roam_goalpose.objects import FORMATS, IsolatedLoader, Limits, ObjectError
from roam_goalpose.objects.readers.registry import find
from roam_goalpose.objects.reading import read_geometry

MANY = int(os.environ.get("ROAM_FUZZ_EXAMPLES", "0"))
LIMITS = Limits(bytes=2**20, vertices=50_000, faces=50_000)


def _zipped(name, content):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return packed.getvalue()


def _scan():
    """An E57 file, which its library only writes to disk."""
    with tempfile.TemporaryDirectory() as folder:
        return e57(Path(folder))


def _seeds():
    chair = box_chair()
    cloud = np.random.default_rng(0).uniform(0, 1, (120, 3)).astype("<f4")
    npy = io.BytesIO()
    np.save(npy, cloud)
    header = (
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 120\nHEIGHT 1\nPOINTS 120\nDATA {}\n"
    )
    columns = np.ascontiguousarray(cloud.T).tobytes()
    packed = b"".join(bytes([len(columns[i : i + 32]) - 1]) + columns[i : i + 32] for i in range(0, len(columns), 32))
    compressed = struct.pack("<II", len(packed), len(columns)) + packed
    gltf = trimesh.exchange.gltf.export_gltf(trimesh.Scene([chair]), embed_buffers=True)["model.gltf"]
    return {
        "obj": [chair.export(file_type="obj").encode()],
        "off": [chair.export(file_type="off").encode()],
        "stl": [chair.export(file_type="stl"), chair.export(file_type="stl_ascii").encode()],
        "ply": [chair.export(file_type="ply"), chair.export(file_type="ply", encoding="ascii")],
        "glb": [chair.export(file_type="glb")],
        "gltf": [gltf],
        "npy": [npy.getvalue()],
        "usd": [usda()],
        "usdz": [usdz()],
        "dae": [dae()],
        "3mf": [threemf()],
        "fbx": [fbx()],
        "las": [las(), las(compressed=True)],
        "e57": [_scan()],
        "zip": [_zipped("chair.obj", chair.export(file_type="obj").encode()), _zipped("chair.gltf", gltf)],
        "xyz": ["\n".join(f"{x} {y} {z}" for x, y, z in cloud).encode()],
        "pcd": [
            header.format("binary").encode() + cloud.tobytes(),
            header.format("binary_compressed").encode() + compressed,
        ],
    }


SEEDS = _seeds()
# Pieces that readers stumble over.
_TOKENS = [
    b"nan",
    b"inf",
    b"1e30",
    b"-1",
    b"0",
    b"99999999999",
    b"1/2/3",
    b"//",
    b"\n\n",
    b"\x00" * 8,
    b"\xff" * 8,
    b"{",
    b"]",
    b'"',
]


# Not what other tests register.
SHIPPED = [name for name in FORMATS if find(name).read.startswith("roam_goalpose.")]


@st.composite
def _mutations(draw, format):
    data = bytearray(draw(st.sampled_from(SEEDS[format])))
    # Headers are where the promises are: half of the changes go into the first 300 bytes.
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, min(len(data) - 1, 300)) | st.integers(0, len(data) - 1))
        kind = draw(st.sampled_from(["byte", "cut", "token", "repeat", "number"]))
        if kind == "byte":
            data[at] = draw(st.integers(0, 255))
        elif kind == "cut":
            del data[at : at + draw(st.integers(1, 200))]
        elif kind == "token":
            data[at:at] = draw(st.sampled_from(_TOKENS))
        elif kind == "repeat":
            data[at:at] = data[at : at + draw(st.integers(1, 400))]
        else:
            data[at : at + 4] = struct.pack("<I", draw(st.sampled_from([0, 1, 2**16, 10**9, 2**31 - 1, 2**32 - 1])))
        if not data:
            break
    return bytes(data)


# Libraries that a bad file may bring down with their process: theirs is a child, as on servers.
NATIVE = ("fbx", "e57", "usd", "usdz", "las")


@pytest.fixture(scope="module")
def child():
    with IsolatedLoader(limits=LIMITS) as loader:
        yield loader


def _read_or_refuse(data, format, child):
    if format in NATIVE:
        with contextlib.suppress(ObjectError):
            child.load(data, format)
        return
    try:
        geometry = read_geometry(data, format, LIMITS)
    except ObjectError:
        return
    assert np.isfinite(geometry.vertices).all()
    if geometry.faces is not None:
        assert geometry.faces.min() >= 0
        assert geometry.faces.max() < len(geometry.vertices)


def _sized(format, few):
    """So many examples, or MANY; fewer where each goes through the child, fewest where that ends after each."""
    share = 100 if find(format).fragile else 30 if format in NATIVE else 1
    count = max(1, MANY // share) if MANY else max(1, few // 5) if format in NATIVE else few
    return settings(max_examples=count, deadline=None, derandomize=not MANY, database=None)


@pytest.mark.parametrize("format", SHIPPED)
@pytest.mark.filterwarnings("ignore")
def test_mutated_files(format, child):
    @settings(_sized(format, 60), suppress_health_check=list(HealthCheck))
    @given(_mutations(format))
    def read(data):
        _read_or_refuse(data, format, child)

    read()


@pytest.mark.parametrize("format", SHIPPED)
@pytest.mark.filterwarnings("ignore")
def test_random_bytes_are_refused(format, child):
    @settings(_sized(format, 30), suppress_health_check=list(HealthCheck))
    @given(st.binary(max_size=400))
    def read(data):
        with pytest.raises(ObjectError):
            child.load(data, format) if format in NATIVE else read_geometry(data, format, LIMITS)

    read()
