import os
import signal
import struct
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from box_furniture import box_chair
from roam_goalpose.objects import IsolatedLoader, Limits, ObjectError, load_shape


@pytest.fixture(scope="module")
def chair_file():
    return box_chair().export(file_type="glb")


@pytest.fixture(scope="module")
def loader():
    with IsolatedLoader(limits=Limits(vertices=500_000)) as loader:
        loader.warm()
        yield loader


def _refused(loader, data, format, **options):
    with pytest.raises(ObjectError) as caught:
        loader.load(data, format, **options)
    return caught.value.reason


def _pid(loader):
    return loader._readers[0]._process.pid


def test_the_shape_is_the_one_of_load_shape(loader, chair_file):
    for options in ({}, {"up": "z", "unit": "m"}):
        here, there = load_shape(chair_file, "glb", **options), loader.load(chair_file, "glb", **options)
        assert there.name == here.name
        assert there.warnings == here.warnings
        assert there.floor_height == here.floor_height
        for name in ("points", "normals", "bounds", "object_to_world"):
            np.testing.assert_array_equal(getattr(there, name), getattr(here, name))
        np.testing.assert_array_equal(there.mesh[0], here.mesh[0])
        np.testing.assert_array_equal(there.mesh[1], here.mesh[1])
        points = np.random.default_rng(0).uniform(-1, 1, (100, 3))
        np.testing.assert_array_equal(there.distance.sample(points), here.distance.sample(points))


def test_a_cloud_and_its_warnings_cross_the_boundary(loader):
    points = np.random.default_rng(0).uniform([-18, 0, -18], [18, 36, 18], (3000, 3))
    text = "\n".join(f"{x:.3f} {y:.3f} {z:.3f}" for x, y, z in points).encode()
    shape = loader.load(text, "xyz")
    assert shape.normals is None
    assert shape.mesh is None
    assert "OBJECT_UNIT_UNSURE" in [warning.reason for warning in shape.warnings]


def test_errors_cross_the_boundary_and_the_reader_lives_on(loader, chair_file):
    before = _pid(loader)
    assert _refused(loader, b"v 0 0 0\n", "obj") == "OBJECT_TOO_FEW_POINTS"
    assert _refused(loader, chair_file[:-100], "glb") == "OBJECT_MALFORMED"
    assert _refused(loader, chair_file, "obj") == "OBJECT_FORMAT_MISMATCH"
    assert _refused(loader, chair_file, "glb", unit="mm") == "OBJECT_SIZE_IMPLAUSIBLE"
    assert loader.load(chair_file, "glb").name.startswith("objects/")
    assert _pid(loader) == before


def test_a_reader_that_dies_is_replaced(loader, chair_file):
    before = _pid(loader)
    os.kill(before, 9)
    loader._readers[0]._process.wait()
    assert loader.load(chair_file, "glb").name.startswith("objects/")
    assert _pid(loader) != before


def _endless_obj():
    """A megabyte that takes trimesh's general face parser long: polygons of growing size."""
    vertices = "".join(f"v {x % 7} {x % 11} {x % 13}\n" for x in range(3000))
    return (
        vertices
        + "".join("f " + " ".join(str(1 + (k * 7) % 3000) for k in range(3 + n % 40)) + "\n" for n in range(20_000))
    ).encode()


def test_time_is_bounded(chair_file):
    """First by the kernel's count of CPU time, then, in the replacement, by the clock; it serves again in the end."""
    with IsolatedLoader(limits=Limits(cpu_seconds=0.0)) as loader:
        assert _refused(loader, _endless_obj(), "obj") == "OBJECT_TOO_COMPLEX"
        assert loader._readers[0]._process.returncode == -signal.SIGXCPU
        loader._readers[0]._limits = Limits(wall_seconds=0.02)
        loader.limits = Limits()
        assert _refused(loader, _endless_obj(), "obj") == "OBJECT_TOO_COMPLEX"
        assert loader._readers[0]._process.returncode == -signal.SIGKILL


@pytest.mark.skipif(sys.platform == "darwin", reason="macOS does not enforce RLIMIT_AS")
def test_memory_is_bounded():
    """A file within the counts whose reading needs more than the process may have."""
    count = 400_000
    triangles = np.zeros(count, dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("pad", "<u2")])
    triangles["corners"] = np.random.default_rng(0).uniform(0, 1, (count, 3, 3))
    data = bytes(80) + struct.pack("<I", count) + triangles.tobytes()
    with IsolatedLoader(limits=Limits(memory_bytes=350 * 2**20)) as loader:
        assert _refused(loader, data, "stl") == "OBJECT_TOO_COMPLEX"


def test_bytes_are_checked_before_a_reader_is_bothered():
    with IsolatedLoader(limits=Limits(bytes=1000)) as loader:
        assert _refused(loader, b"v" * 1001, "obj") == "OBJECT_TOO_LARGE"
        assert _refused(loader, b"", "obj") == "OBJECT_EMPTY"
        assert loader._readers[0]._process is None


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="reads the process's environment from /proc")
def test_readers_get_no_secrets_and_end_with_the_loader(monkeypatch):
    monkeypatch.setenv("ROAM_API_KEY", "secret")
    with IsolatedLoader() as loader:
        loader.warm()
        assert b"secret" not in Path(f"/proc/{_pid(loader)}/environ").read_bytes()
        process = loader._readers[0]._process
    assert process.poll() is not None
    with pytest.raises(RuntimeError):
        loader.load(b"v", "obj")


def test_several_threads_share_the_readers(loader, chair_file):
    names = []
    threads = [threading.Thread(target=lambda: names.append(loader.load(chair_file, "glb").name)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(names) == 4
    assert len(set(names)) == 1
