"""Commands whose work and options live in another package."""

import importlib
import sys
from collections.abc import Callable, Sequence

import typer

from roam_command.checkout import checkout
from roam_command.reports import UsageError, reported


def delegate(module: str, arguments: Sequence[str], *, name: str) -> None:
    """Runs `module.main(arguments)`; its answer, if a number, is the exit code."""
    with reported(as_json=False):
        main = _load(module, name)
    # The program's own --help should show the command that the person typed.
    sys.argv = [name, *arguments]
    answer = main(list(arguments))
    raise typer.Exit(answer if isinstance(answer, int) else 0)


def _load(module: str, name: str) -> Callable[[list[str]], object]:
    root = checkout()
    if root is not None and str(root) not in sys.path:
        sys.path.append(str(root))  # evaluation/ is part of the checkout, not of an installed package
    try:
        return importlib.import_module(module).main
    except ModuleNotFoundError as error:
        package = module.partition(".")[0]
        if error.name is None or error.name.partition(".")[0] != package:
            raise
        raise UsageError(
            f"`{name}` needs {module}, which is not installed here",
            remedy="Run it in a checkout of ROAM Services after scripts/install.",
        ) from error
