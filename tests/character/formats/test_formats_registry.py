"""The table of formats: endings are unique, files appear whole or not at all, others may add their own."""

from pathlib import Path

import pytest
from roam_character.formats import registry
from roam_character.formats.registry import ExportError, Format
from roam_character.formats.scene import Scene


def test_every_format_has_its_own_endings_and_writes_what_it_says(turning, tmp_path):
    taken = [ending for item in registry.formats() for ending in item.extensions]
    assert len(taken) == len(set(taken))
    for item in registry.formats():
        if item.write is None or item.missing():
            continue
        for ending in item.extensions:
            registry.write(tmp_path / f"motion{ending}", Scene(turning))
            assert (tmp_path / f"motion{ending}").stat().st_size > 100
            if item.poses:
                registry.write(tmp_path / f"pose{ending}", Scene(turning.pose(3)))
    left = {path.name for path in tmp_path.iterdir()}
    assert not [name for name in left if "part" in name]


def test_a_file_that_fails_leaves_the_old_one_and_no_rest(turning, tmp_path):
    def breaks(path: Path, scene: Scene) -> list[str]:
        path.write_text("half")
        raise OSError("disk full")

    registry.register(Format("breaking", "Breaks", (".breaks",), write=breaks))
    try:
        (tmp_path / "a.breaks").write_text("old")
        with pytest.raises(OSError, match="disk full"):
            registry.write(tmp_path / "a.breaks", Scene(turning))
        assert (tmp_path / "a.breaks").read_text() == "old"
        assert [path.name for path in tmp_path.iterdir()] == ["a.breaks"]
    finally:
        registry.unregister("breaking")


def test_an_ending_belongs_to_one_format(turning, tmp_path):
    with pytest.raises(ValueError, match="glb's"):
        registry.register(Format("mine", "Mine", (".glb",)))
    with pytest.raises(ExportError, match="no known format"):
        registry.write(tmp_path / "a.doc", Scene(turning))


def test_bvh_is_read_and_others_say_what_is(turning, tmp_path):
    registry.write(tmp_path / "a.bvh", Scene(turning))
    assert len(registry.read(tmp_path / "a.bvh")) == 40
    with pytest.raises(ExportError, match="cannot be read"):
        registry.read(tmp_path / "a.glb")
