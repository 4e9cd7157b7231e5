"""Values kept between processes: found by the same build alone, and never taken from a folder of somebody else's."""

from pathlib import Path

import pytest
from roam_serving.kept import FOLDER, KeptValues, build_mark, cache_folder


def test_a_value_is_found_again_by_the_same_build_and_key(tmp_path: Path) -> None:
    KeptValues("things", "one", tmp_path).put("a", {"b": 1})
    assert KeptValues("things", "one", tmp_path).get("a") == {"b": 1}
    assert KeptValues("things", "one", tmp_path).get("c") is None
    assert KeptValues("things", "two", tmp_path).get("a") is None


def test_a_broken_file_counts_as_none(tmp_path: Path) -> None:
    kept = KeptValues("things", "one", tmp_path)
    kept.put("a", [1, 2, 3])
    (file,) = (tmp_path / "things" / "one").iterdir()
    file.write_bytes(file.read_bytes()[:-3])
    assert kept.get("a") is None


def test_a_folder_that_others_may_write_is_not_read(tmp_path: Path) -> None:
    KeptValues("things", "one", tmp_path).put("a", 1)
    (tmp_path / "things" / "one").chmod(0o777)
    assert KeptValues("things", "one", tmp_path).get("a") is None


def test_where_nothing_can_be_written_nothing_is_kept(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    kept = KeptValues("things", "one", tmp_path / "file")
    kept.put("a", 1)
    assert kept.get("a") is None


def test_files_of_old_builds_go(tmp_path: Path) -> None:
    for build in "abcdefg":
        KeptValues("things", build, tmp_path).put("a", 1)
    assert len(list((tmp_path / "things").iterdir())) == 4
    assert KeptValues("things", "g", tmp_path).get("a") == 1


def test_the_mark_is_of_the_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "some_marked_package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "mathematics.py").write_text("ONE = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    before = build_mark([package.name], ["numpy"])
    assert before == build_mark([package.name], ["numpy"])
    (package / "mathematics.py").write_text("ONE = 2\n")
    assert before != build_mark([package.name], ["numpy"])


def test_the_environment_names_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    assert cache_folder() == tmp_path
    monkeypatch.setenv(FOLDER, "")
    assert cache_folder() is None
