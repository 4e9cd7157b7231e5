"""`roam train …` and `roam evaluate …` hand their words to the programs that own them."""

import sys
from types import ModuleType

import pytest
from roam_command.main import app
from typer.testing import CliRunner

COMMANDS = {
    ("train", "field"): "roam_goalpose.training.field",
    ("train", "motion"): "roam_motion.training.motion",
    ("evaluate", "field"): "roam_goalpose.training.evaluate_field",
    ("evaluate", "goalpose"): "roam_evaluation.goalpose.success",
    ("evaluate", "motion"): "roam_evaluation.motion.approaches",
    ("evaluate", "throughput"): "roam_evaluation.service.throughput",
    ("evaluate", "load"): "roam_evaluation.service.load",
}


@pytest.mark.parametrize("command", COMMANDS)
def test_arguments_are_passed_on_and_the_answer_is_the_exit_code(monkeypatch, command):
    seen: list[list[str]] = []
    program = ModuleType(COMMANDS[command])
    program.main = lambda arguments: seen.append(arguments) or 7  # type: ignore[attr-defined]
    package = COMMANDS[command].partition(".")[0]
    if package == "evaluation":
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
    monkeypatch.setitem(sys.modules, COMMANDS[command], program)
    result = CliRunner().invoke(app, [*command, "--resume", "--help", "runs/x"])
    assert result.exit_code == 7, result.output
    assert seen == [["--resume", "--help", "runs/x"]]


def test_a_missing_package_says_what_to_do(monkeypatch):
    monkeypatch.setitem(sys.modules, "roam_goalpose.training.field", None)
    result = CliRunner().invoke(app, ["train", "field"])
    assert result.exit_code == 2
    assert "scripts/install" in result.stderr
