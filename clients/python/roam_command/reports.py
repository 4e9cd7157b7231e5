"""What a command says: progress and warnings on stderr, the result on stdout, errors as sentences with a remedy."""

import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import IntEnum
from typing import Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from roam_client import (
    AccessDeniedError,
    ConnectionFailedError,
    FormatError,
    InvalidRequestError,
    NotFoundError,
    RequestTimeoutError,
    RoamError,
    ServerError,
    Warning,
)

stderr = Console(stderr=True, highlight=False)


class Exit(IntEnum):
    """Exit codes of `roam`."""

    DONE = 0
    FAILED = 1
    USAGE = 2
    NO_SERVER = 3
    REFUSED = 4
    INTERRUPTED = 130


class UsageError(RoamError):
    """The command line asks for something that cannot be; `remedy` says what would do."""

    def __init__(self, message: str, *, remedy: str = "") -> None:
        super().__init__(message)
        self.remedy = remedy


def exit_code(error: RoamError) -> Exit:
    """The exit code of an error."""
    match error:
        case UsageError() | FormatError():
            return Exit.USAGE
        case ConnectionFailedError() | RequestTimeoutError():
            return Exit.NO_SERVER
        case InvalidRequestError() | NotFoundError() | AccessDeniedError():
            return Exit.REFUSED
        case _:
            return Exit.FAILED


def remedy_of(error: RoamError) -> str:
    """What a person can do about an error."""
    if isinstance(error, UsageError | ServerError):
        return error.remedy
    if isinstance(error, ConnectionFailedError | RequestTimeoutError):
        return "Is the server running? `roam serve` starts one; without --server the command starts its own."
    return ""


@contextmanager
def reported(*, as_json: bool) -> Iterator[None]:
    """Tells errors of the block and ends the command with their exit code; Ctrl-C ends it quietly."""
    try:
        yield
    except RoamError as error:
        _tell(error, as_json=as_json)
        raise typer.Exit(exit_code(error)) from error
    except BrokenPipeError as error:
        # Whoever read stdout (head, less) has enough; Python must not complain about it while it ends either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise typer.Exit(Exit.DONE) from error
    except OSError as error:
        _tell(RoamError(_sentence(error)), as_json=as_json)
        raise typer.Exit(Exit.FAILED) from error
    except KeyboardInterrupt as error:
        stderr.print("interrupted")
        raise typer.Exit(Exit.INTERRUPTED) from error


def _sentence(error: OSError) -> str:
    """What the system refused, with the file and without the error's number."""
    said = error.strerror or str(error)
    return f"{error.filename}: {said}" if error.filename else said


def _tell(error: RoamError, *, as_json: bool) -> None:
    reason = error.reason if isinstance(error, ServerError) else type(error).__name__
    remedy = remedy_of(error)
    if as_json:
        typer.echo(json.dumps({"error": {"reason": reason, "message": str(error), "remedy": remedy}}))
    stderr.print(f"[red]error:[/] {_plain(str(error))}")
    if remedy:
        stderr.print(f"       {_plain(remedy)}")


def tell_warnings(warnings: Sequence[Warning]) -> None:
    """Prints what the server found doubtful."""
    for warning in warnings:
        remedy = f" {warning.remedy}" if warning.remedy else ""
        stderr.print(f"[yellow]warning:[/] {_plain(warning.message)}{_plain(remedy)}")


def _plain(text: str) -> str:
    return text.replace("[", r"\[")


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """A bar on stderr; silent where stderr is not a terminal."""
    # Above a bar rich prints on the bar's stream: results may be on their way to a file.
    above = sys.stdout.isatty()
    columns = (TextColumn("{task.description:<28}"), BarColumn(bar_width=32), TextColumn("{task.fields[note]}"))
    with Progress(
        *columns, TimeElapsedColumn(), console=stderr, disable=not stderr.is_terminal, redirect_stdout=above
    ) as progress:
        yield progress


def print_result(result: dict[str, Any], lines: Sequence[tuple[str, str]], *, as_json: bool) -> None:
    """The result on stdout: one JSON object, or a few `name  value` lines for people."""
    if as_json:
        typer.echo(json.dumps(result, allow_nan=False))
        return
    width = max(len(name) for name, _ in lines)
    for name, value in lines:
        typer.echo(f"{name:<{width}}  {value}")


def centimetres(metres: float | None) -> str:
    """A length for people."""
    return "not measured" if metres is None else f"{metres * 100:.1f} cm"
