from pathlib import Path

import pytest
from box_furniture import box_chair
from roam_goalpose.objects import FORMATS, REASONS, ObjectError, format_of
from roam_goalpose.objects.readers.registry import check_content, check_format, sniff


@pytest.mark.parametrize("format", FORMATS)
def test_extensions_in_any_case(format):
    assert format_of(Path("some.dir") / f"My chair.{format.upper()}") == format
    assert check_format(f".{format}") == format


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("chair", "OBJECT_FORMAT_UNKNOWN"),
        ("chair.xcf", "OBJECT_FORMAT_UNKNOWN"),
        ("chair.step", "OBJECT_FORMAT_UNSUPPORTED"),
        ("chair.stp", "OBJECT_FORMAT_UNSUPPORTED"),
        ("chair.skp", "OBJECT_FORMAT_UNSUPPORTED"),
        ("chair.blend", "OBJECT_FORMAT_UNSUPPORTED"),
        ("chair.tar.gz", "OBJECT_FORMAT_UNSUPPORTED"),
        ("chair.pkl", "OBJECT_FORMAT_UNSUPPORTED"),
    ],
)
def test_other_extensions_are_explained(name, reason):
    with pytest.raises(ObjectError) as caught:
        format_of(name)
    assert caught.value.reason == reason
    assert caught.value.field == "format"
    assert all(format in caught.value.remedy for format in FORMATS)


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"BZh91AY&SY", "bz2"),
        (b"\x1f\x8b\x08\x00", "gz"),
        (b"\x80\x04\x95\x00", "pkl"),
        (b"ISO-10303-21;\n", "step"),
        (b"BLENDER-v300", "blend"),
        (b"<!DOCTYPE html><html>", "html"),
        (b"\x89PNG\r\n", "png"),
    ],
)
@pytest.mark.parametrize("format", ["obj", "glb", "npy"])
def test_archives_pickles_and_other_programs_files_are_named(data, found, format):
    assert sniff(data) == found
    with pytest.raises(ObjectError) as caught:
        check_content(data, format)
    assert (caught.value.reason, caught.value.field) == ("OBJECT_FORMAT_UNSUPPORTED", "content")


@pytest.mark.parametrize("format", ["obj", "glb", "ply", "stl", "off"])
def test_every_written_format_passes_as_itself(format):
    data = box_chair().export(file_type=format)
    check_content(data.encode() if isinstance(data, str) else data, format)


@pytest.mark.parametrize("wrong", ["obj", "ply", "stl", "gltf", "pcd"])
def test_a_wrong_extension_is_told_the_right_one(wrong):
    with pytest.raises(ObjectError) as caught:
        check_content(box_chair().export(file_type="glb"), wrong)
    assert caught.value.reason == "OBJECT_FORMAT_MISMATCH"
    assert "'glb'" in caught.value.remedy


def test_errors_survive_a_round_trip():
    with pytest.raises(ObjectError) as caught:
        check_format("step")
    again = ObjectError.from_dict(caught.value.to_dict())
    assert again.to_dict() == caught.value.to_dict()
    assert str(again) == str(caught.value)


def test_unknown_reasons_cannot_be_raised():
    with pytest.raises(KeyError):
        ObjectError("OBJECT_UGLY", field="content", message="", remedy="")
    assert all(reason.startswith("OBJECT_") for reason in REASONS)


@pytest.mark.parametrize(
    ("data", "found"),
    [
        (b"PK\x03\x04rest", "zip"),
        (b"Kaydara FBX Binary  \x00", "fbx"),
        (b'<?xml version="1.0"?>\n<COLLADA xmlns=', "dae"),
        (b"#usda 1.0\n", "usd"),
        (b"LASF", "las"),
        (b"ASTM-E57", "e57"),
    ],
)
def test_formats_with_a_mark_are_recognised(data, found):
    assert sniff(data) == found
    with pytest.raises(ObjectError) as caught:
        check_content(data, "obj")
    assert (caught.value.reason, caught.value.field) == ("OBJECT_FORMAT_MISMATCH", "format")


@pytest.mark.parametrize(("name", "converter"), [("step", "FreeCAD"), ("skp", "SketchUp"), ("ifc", "IfcConvert")])
def test_what_is_not_read_names_a_converter(name, converter):
    with pytest.raises(ObjectError) as caught:
        check_format(name)
    assert converter in caught.value.remedy
