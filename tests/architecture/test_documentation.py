"""Documents that cannot be run are read instead: links lead somewhere, commands and settings exist."""

import re
from pathlib import Path

import pytest
import typer
from roam_command.main import app
from roam_goalpose.settings import GoalPoseSettings
from roam_motion.settings import MotionSettings
from roam_serving.settings import ServerSettings

ROOT = Path(__file__).parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINK = re.compile(r"\[[^\]]*\]\((?!https?:|#)([^)#\s]+)")
COMMAND = re.compile(r"^(?:\.venv/bin/)?roam ([a-z]+)(?: ([a-z]+))?", re.MULTILINE)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(document: Path) -> None:
    dead = [link for link in LINK.findall(document.read_text()) if not (document.parent / link).exists()]
    assert dead == []


def test_commands_in_the_readme_exist() -> None:
    commands = typer.main.get_command(app).commands
    named = COMMAND.findall((ROOT / "README.md").read_text())
    assert named
    for command, below in named:
        assert command in commands
        if command in {"train", "evaluate"}:
            assert below in commands[command].commands


@pytest.mark.parametrize("settings", [ServerSettings, GoalPoseSettings, MotionSettings])
def test_every_setting_is_documented(settings: type[ServerSettings]) -> None:
    text = (ROOT / "docs" / "how-to" / "operations.md").read_text()
    assert [name for name in settings.model_fields if f"ROAM_{name.upper()}" not in text] == []
