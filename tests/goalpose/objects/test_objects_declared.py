"""Formats that say their unit and their up axis are believed: the box chair, in each of them, in several units."""

import importlib.util

import numpy as np
import pytest
from new_formats import dae, e57, fbx, las, threemf, usda, usdz
from roam_goalpose.objects import IsolatedLoader, Limits, ObjectError, load_shape

BOUNDS = np.array([[-0.24, 0.0, -0.24], [0.24, 0.92, 0.24]])


def _is_the_chair(shape, atol=1e-3):
    np.testing.assert_allclose(shape.bounds, BOUNDS, atol=atol)
    assert shape.front[2] > 0.5
    assert not [warning.reason for warning in shape.warnings]


@pytest.mark.parametrize("up", ["Y", "Z"])
@pytest.mark.parametrize("metres", [1.0, 0.01, 0.001, 0.0254])
def test_usd(up, metres):
    pytest.importorskip("pxr")
    _is_the_chair(load_shape(usda(up, metres), "usd"))


def test_usd_without_a_unit_is_in_centimetres_and_says_so():
    pytest.importorskip("pxr")
    shape = load_shape(usda().replace(b"    metersPerUnit = 0.01\n", b""), "usd")
    assert np.ptp(shape.bounds[:, 1]) == pytest.approx(0.92, abs=1e-3)
    assert [warning.reason for warning in shape.warnings] == ["OBJECT_UNIT_UNSURE"]


def test_usdz():
    pytest.importorskip("pxr")
    _is_the_chair(load_shape(usdz(), "usdz"))


@pytest.mark.parametrize("target", ["/etc/passwd", "../outside.usda", "missing.usda"])
def test_usd_opens_no_other_file(target):
    pytest.importorskip("pxr")
    layer = usda().replace(b'def Xform "chair"\n{', f'def Xform "chair" (references = @{target}@)\n{{'.encode())
    with pytest.raises(ObjectError) as caught:
        load_shape(layer, "usd")
    assert caught.value.reason == "OBJECT_EXTERNAL_FILE"


@pytest.mark.parametrize("up", ["Y_UP", "Z_UP"])
@pytest.mark.parametrize("metres", [1.0, 0.01, 0.0254])
def test_dae(up, metres):
    _is_the_chair(load_shape(dae(up, metres), "dae"))


def test_dae_with_entities_is_refused():
    bomb = dae().replace(b"<COLLADA", b'<!DOCTYPE a [<!ENTITY a "aaaa">]><COLLADA', 1)
    with pytest.raises(ObjectError) as caught:
        load_shape(bomb, "dae")
    assert "entities" in caught.value.message


@pytest.mark.parametrize(("unit", "metres"), [("millimeter", 0.001), ("inch", 0.0254), ("meter", 1.0)])
def test_3mf(unit, metres):
    _is_the_chair(load_shape(threemf(unit, metres), "3mf"))


@pytest.mark.parametrize("up", [1, 2])
@pytest.mark.parametrize("centimetres", [1.0, 100.0, 2.54])
def test_fbx(up, centimetres):
    _needs("ufbx")
    with IsolatedLoader() as loader:  # in this process the library ends the interpreter badly
        _is_the_chair(loader.load(fbx(up, centimetres), "fbx"))


def _needs(*modules):
    for module in modules:
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"needs {module}: pip install roam-services[formats]")


@pytest.mark.parametrize("compressed", [False, True])
def test_las(compressed):
    pytest.importorskip("laspy")
    _is_the_chair(load_shape(las(compressed), "las"), atol=0.02)


def test_e57(tmp_path):
    pytest.importorskip("pye57")
    _is_the_chair(load_shape(e57(tmp_path), "e57"), atol=0.02)


def test_the_same_through_the_process_that_may_not_write(tmp_path):
    _needs("pxr", "ufbx", "pye57", "laspy")
    with IsolatedLoader(limits=Limits(cpu_seconds=60.0, wall_seconds=120.0)) as loader:
        for data, format in ((usda(), "usd"), (usdz(), "usdz"), (dae(), "dae"), (threemf(), "3mf"), (fbx(), "fbx")):
            _is_the_chair(loader.load(data, format))
        for data, format in ((las(True), "las"), (e57(tmp_path), "e57")):
            _is_the_chair(loader.load(data, format), atol=0.02)


@pytest.mark.parametrize(("format", "data"), [("dae", dae(metres=1.0)), ("3mf", threemf("meter", 1.0))])
def test_cut_files_are_refused_in_plain_words(format, data):
    for length in (len(data) // 3, len(data) // 2, len(data) - 10):
        with pytest.raises(ObjectError) as caught:
            load_shape(data[:length], format)
        assert "Error" not in caught.value.message
        assert "Traceback" not in caught.value.message
