"""A format of somebody else's, added in this one file, is offered and written by the command."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from roam_character.formats import registry
from roam_character.formats.registry import Format
from roam_character.formats.scene import Scene
from roam_command.main import app
from typer.testing import CliRunner

CHAIR = Path(__file__).parents[2] / "examples/objects/chair.glb"


def write(path: Path, scene: Scene) -> Sequence[str]:
    """One line for each joint of the first frame."""
    clip = scene.clip
    lines = [
        f"{name} {x:.4f} {y:.4f} {z:.4f}"
        for name, (x, y, z) in zip(clip.skeleton.joint_names, clip.positions()[0], strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    return ("only the first frame is kept",)


@pytest.fixture
def lines() -> Iterator[Format]:
    item = registry.register(Format("lines", "Joint positions as lines", (".lines",), write=write))
    yield item
    registry.unregister(item.name)


def test_a_toy_format_end_to_end(lines, tmp_path):
    assert ".lines" in registry.endings(poses=True)
    out = tmp_path / "pose.lines"
    result = CliRunner().invoke(app, ["pose", str(CHAIR), "-o", str(out), "--json"])
    assert result.exit_code == 0, result.output
    answer = json.loads(result.stdout)
    assert answer["files"] == [str(out)]
    name, *place = out.read_text().splitlines()[0].split()
    assert name == "hips"
    assert [float(value) for value in place] == pytest.approx(answer["root_position"], abs=1e-3)
