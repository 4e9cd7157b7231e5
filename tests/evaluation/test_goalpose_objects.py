"""Which objects are evaluated on."""

from pathlib import Path

from roam_evaluation.goalpose.inputs.objects import EvaluationObject, find_objects, generated_objects, spread

OBJECTS = Path(__file__).parents[2] / "examples" / "objects"


def test_a_folder_without_a_catalogue(tmp_path):
    (tmp_path / "stool.obj").write_text("")
    (tmp_path / "notes.txt").write_text("")
    assert [(o.name, o.category, o.seat_height) for o in find_objects([tmp_path], [], categories=None)] == [
        ("stool", "unknown", None)
    ]


def test_a_catalogue_tells_kind_and_seat(tmp_path):
    (tmp_path / "a.obj").write_text("")
    (tmp_path / "b.obj").write_text("")
    (tmp_path / "CATALOG.csv").write_text("file,category,subtype,seat_height_m\na.obj,chair,,0.45\nb.obj,bed,,0.5\n")
    assert [o.seat_height for o in find_objects([tmp_path], [], categories=None)] == [0.45]
    assert [o.name for o in find_objects([tmp_path], [], categories={"bed"})] == ["b"]


def test_generated_pieces_are_the_same_every_time():
    first, again = (generated_objects(3, categories={"chair", "stool"}) for _ in range(2))
    assert [o.category for o in first] == ["chair", "chair", "stool"]
    assert first[0].read() == again[0].read()
    assert first[0].read() != first[1].read()
    assert first[0].format == "ply"


def test_a_limit_takes_from_all_over_the_list():
    items = [EvaluationObject(Path(f"{k}.obj"), "chair", "", None) for k in range(10)]
    assert [item.name for item in spread(items, 4)] == ["0", "3", "6", "9"]
    assert spread(items, 20) == items
