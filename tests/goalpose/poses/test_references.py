import json
import shutil

import numpy as np
import pytest
from roam_goalpose.references.pairs import load_reference, load_references
from solving import REFERENCES, pair


def test_shipped_pairs_cover_sitting_and_lying():
    pairs = load_references(REFERENCES)
    assert {"chair_sit", "sofa_sit", "sofa_lie"} <= set(pairs)
    assert {p.action for p in pairs.values()} == {"sit", "lie"}


@pytest.mark.parametrize("name", ["chair_sit", "sofa_sit", "stool_sit"])
def test_seated_people_face_the_front_with_their_feet_on_the_floor(name):
    pose = pair(name).pose
    assert abs(pose.yaw()) < 0.05
    feet = pose.positions()[[pose.skeleton.index("leftToes"), pose.skeleton.index("rightToes")], 1]
    np.testing.assert_allclose(feet, 0.0255, atol=0.005)


def test_a_record_without_pose_is_refused(tmp_path):
    record = json.loads((REFERENCES / "stool_sit.json").read_text())
    del record["rotations"]
    (tmp_path / "stool_sit.json").write_text(json.dumps(record))
    with pytest.raises(ValueError, match="rotations"):
        load_reference(tmp_path / "stool_sit.json")


def test_an_unknown_action_is_refused(tmp_path):
    record = json.loads((REFERENCES / "stool_sit.json").read_text()) | {"action": "dance"}
    (tmp_path / "stool_sit.json").write_text(json.dumps(record))
    shutil.copy(REFERENCES / "stool_sit.glb", tmp_path)
    with pytest.raises(ValueError, match="dance"):
        load_reference(tmp_path / "stool_sit.json")


def test_an_empty_folder_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"build\.py"):
        load_references(tmp_path)
