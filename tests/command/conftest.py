"""The command against the client's fake services: quick, and without any model."""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from roam_character.body import body_capsules
from roam_character.kinematics import forward_kinematics
from roam_character.skeleton import humanoid_skeleton
from roam_serving.endpoints.skeletons import skeleton_message

sys.path.insert(0, str(Path(__file__).parents[1] / "client"))

import fake_services
from fake_services import Fake


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Iterator[Fake]:
    """The fakes with the real figure in T-pose: exporters need its bones."""
    figure = humanoid_skeleton()
    identity = np.tile(np.array([0, 0, 0, 1], np.float32), (figure.joint_count, 1))
    rest = forward_kinematics(figure, np.zeros(3, np.float32), identity).positions
    message = skeleton_message(figure, body_capsules(figure))
    monkeypatch.setattr(fake_services, "SKELETON", message.skeleton)
    monkeypatch.setattr(fake_services, "IDENTITY", identity)
    monkeypatch.setattr(fake_services, "positions_of", lambda root: np.asarray(root, np.float32) + rest)
    with fake_services.fake_services() as running:
        yield running


@pytest.fixture
def chair(tmp_path: Path) -> Path:
    """A file that the fake takes for a chair; its cube is real enough for a display mesh."""
    path = tmp_path / "chair.obj"
    corners = [(x, y, z) for x in (0, 50) for y in (0, 100) for z in (0, 50)]
    faces = [(1, 3, 2), (2, 3, 4), (5, 6, 7), (6, 8, 7), (1, 2, 5), (2, 6, 5), (3, 7, 4), (4, 7, 8)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join(lines))
    return path
