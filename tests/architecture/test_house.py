"""What every file of this repository keeps to, whoever wrote it."""

import ast
import re
import subprocess
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LONGEST_FILE = 500
LONGEST_FUNCTION = 80
MOST_MODULES = 15
# Folders that hold one registry: as many modules as there are rows.
REGISTRIES = {
    "services/goalpose/roam_goalpose/energy/terms",
    "services/goalpose/roam_goalpose/furniture",
    "services/goalpose/roam_goalpose/objects/readers",
    "services/character/roam_character/formats",
}
VAGUE_NAMES = {"utils", "util", "helpers", "misc", "common"}
# Written in two halves so that this file keeps its own rule.
MACHINE_PATHS = re.compile("|".join("/" + name for name in ("work/", "root/", "tmp/[a-z]", "home/[a-z]")))


def tracked(*patterns: str) -> list[Path]:
    """Files of the index that match, generated stubs and vendored scripts aside."""
    listing = subprocess.run(["git", "ls-files", "-z", "--", *patterns], cwd=ROOT, capture_output=True, check=False)
    if listing.returncode != 0:
        pytest.skip("not a git checkout, so there is no list of files to read")
    paths = [ROOT / name for name in listing.stdout.decode().split("\0") if name]
    return [p for p in paths if p.is_file() and "_pb2" not in p.name and "vendor" not in p.parts]


def python_files() -> list[Path]:
    files = tracked("*.py")
    assert files, "git lists no Python file"
    return files


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


def test_files_stay_readable() -> None:
    lengths = {name_of(p): len(p.read_text().splitlines()) for p in python_files()}
    assert {name: n for name, n in lengths.items() if n > LONGEST_FILE} == {}


def test_functions_stay_readable() -> None:
    long = {}
    for path in python_files():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.end_lineno is not None:
                lines = node.end_lineno - node.lineno + 1
                if lines > LONGEST_FUNCTION:
                    long[f"{name_of(path)}:{node.lineno} {node.name}"] = lines
    assert long == {}


def test_modules_are_named_after_what_they_hold() -> None:
    assert [name_of(p) for p in python_files() if p.stem in VAGUE_NAMES] == []


def test_folders_are_taken_in_at_a_glance() -> None:
    packages = Counter(name_of(p.parent) for p in python_files() if p.name != "__init__.py")
    assert {folder: n for folder, n in packages.items() if n > MOST_MODULES and folder not in REGISTRIES} == {}


def test_every_package_says_what_it_is_for() -> None:
    silent = []
    for path in python_files():
        if path.parts[len(ROOT.parts)] in {"services", "clients", "evaluation"}:
            tree = ast.parse(path.read_text())
            if tree.body and ast.get_docstring(tree) is None:
                silent.append(name_of(path))
    assert silent == []


def test_no_file_names_a_path_of_one_machine() -> None:
    found = []
    for path in tracked(
        "*.py", "*.md", "*.toml", "*.yml", "*.yaml", "*.json", "*.proto", "*.html", "*.js", "scripts/*", ".ci/*"
    ):
        if path == Path(__file__) or path.stat().st_size > 1_000_000:
            continue
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), start=1):
            if MACHINE_PATHS.search(line):
                found.append(f"{name_of(path)}:{number} {line.strip()[:80]}")
    assert found == []
