"""Documents that cannot be run are read instead: links lead somewhere, commands and settings exist."""

import re
from pathlib import Path

import pytest
import typer
from roam_command.main import app
from roam_goalpose.settings import GoalPoseSettings
from roam_motion.settings import MotionSettings
from roam_serving.settings import ServerSettings
from test_house import tracked

ROOT = Path(__file__).parents[2]
FRONT = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")]
MORE = [ROOT / "proto/README.md", *ROOT.glob("clients/*/README.md")]
DOCUMENTS = [*FRONT, *MORE, *sorted((ROOT / "docs").rglob("*.md"))]
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


# What a reader outside this repository cannot look up, and paths of documents that code and documents name.
LOST = re.compile(r"METHOD-NOTES|HUMAN-MOTION|MOTION-TRIALS|INTEROP-NOTES|USERS-AND-PEERS|\bissue #?\d+|shared/design")
NAMED = re.compile(
    r"\b(?:docs|proto|clients|evaluation|examples|weights|requirements|scripts|tests)/[\w./-]*\w\.(?:md|json|py|proto)\b"
)


def cited(path: Path) -> str:
    """A file's words: documents and comments alike, without the addresses of the web."""
    return re.sub(r"https?://\S+", "", path.read_text())


def test_citations_lead_somewhere() -> None:
    lost, missing = [], []
    for path in tracked("*.py", "*.md", "*.proto", "*.yml", "*.yaml", "*.js", "scripts/*"):
        if path == Path(__file__) or "results" in path.parts:
            continue
        text = cited(path)
        lost += [f"{path.relative_to(ROOT)}: {word}" for word in LOST.findall(text)]
        if path.suffix in {".md", ".proto"} or path.parts[len(ROOT.parts)] in {"services", "clients", "evaluation"}:
            names = [
                name for name in NAMED.findall(text) if not any((at / name).exists() for at in (ROOT, path.parent))
            ]
            missing += [f"{path.relative_to(ROOT)}: {name}" for name in names]
    assert lost == []
    assert missing == []
