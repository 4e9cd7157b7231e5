"""Commands whose work and options live in another package."""

import sys
from collections.abc import Sequence

import typer

from roam_command.installation import services_module
from roam_command.reports import reported


def delegate(module: str, arguments: Sequence[str], *, name: str) -> None:
    """Runs `module.main(arguments)`; its answer, if a number, is the exit code."""
    with reported(as_json=False):
        main = services_module(module, wanted_by=f"`{name}`").main
    # The program's own --help should show the command that the person typed.
    sys.argv = [name, *arguments]
    answer = main(list(arguments))
    raise typer.Exit(answer if isinstance(answer, int) else 0)
