"""The command line: names the commands and turns errors into sentences and exit codes."""

from typing import Annotated

import typer
from roam_client.version import __version__

from roam_command.commands import evaluate, train
from roam_command.commands.batch.command import batch
from roam_command.commands.demo import demo
from roam_command.commands.pose import pose
from roam_command.commands.serve import serve
from roam_command.commands.sit import sit

app = typer.Typer(
    name="roam",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode="markdown",
    help="A pose that fits a piece of furniture, and a character that walks up and takes it.",
    epilog="Exit codes: 0 done · 1 failed · 2 wrong usage · 3 no server there · 4 object or request refused · "
    "130 interrupted. Results go to stdout, progress and warnings to stderr.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"roam {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """A pose that fits a piece of furniture, and a character that walks up and takes it."""


PASS_ON = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}

app.command("pose")(pose)
app.command("sit")(sit)
app.command("batch")(batch)
app.command("demo")(demo)
app.command("serve")(serve)

train_app = typer.Typer(no_args_is_help=True, help="Train the networks; every run resumes with --resume.")
train_app.command("field", context_settings=PASS_ON)(train.field)
train_app.command("motion", context_settings=PASS_ON)(train.motion)
app.add_typer(train_app, name="train")

evaluate_app = typer.Typer(no_args_is_help=True, help="Measure quality and speed; results as tables and JSON.")
evaluate_app.command("field", context_settings=PASS_ON)(evaluate.field)
evaluate_app.command("goalpose", context_settings=PASS_ON)(evaluate.goalpose)
evaluate_app.command("motion", context_settings=PASS_ON)(evaluate.motion)
evaluate_app.command("rigs", context_settings=PASS_ON)(evaluate.rigs)
evaluate_app.command("uploads", context_settings=PASS_ON)(evaluate.uploads)
evaluate_app.command("throughput", context_settings=PASS_ON)(evaluate.throughput)
evaluate_app.command("load", context_settings=PASS_ON)(evaluate.load)
app.add_typer(evaluate_app, name="evaluate")


def main() -> None:
    """Entry point of the `roam` script."""
    app()
