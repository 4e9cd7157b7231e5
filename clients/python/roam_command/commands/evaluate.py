"""`roam evaluate field|goalpose|motion|rigs|uploads|throughput|load`: quality and speed on a folder of objects."""

import typer

from roam_command.delegation import delegate


def field(context: typer.Context) -> None:
    """Occupancy of the descriptor field on shapes it never saw (`--help` lists its options)."""
    delegate("roam_goalpose.training.evaluate_field", context.args, name="roam evaluate field")


def goalpose(context: typer.Context) -> None:
    """Goal poses on a folder of furniture: success, penetration, speed (`--help` lists its options)."""
    delegate("roam_evaluation.goalpose.success", context.args, name="roam evaluate goalpose")


def motion(context: typer.Context) -> None:
    """Approaches to a folder of furniture: errors, jumps, foot skate, speed; `--people`: beside captured people."""
    delegate("roam_evaluation.motion.approaches", context.args, name="roam evaluate motion")


def throughput(context: typer.Context) -> None:
    """Goal poses of requests that come at once, against one after another (`--help` lists its options)."""
    delegate("roam_evaluation.service.throughput", context.args, name="roam evaluate throughput")


def load(context: typer.Context) -> None:
    """How many characters a motion server carries, and how evenly their frames come (`--help` lists its options)."""
    delegate("roam_evaluation.service.load", context.args, name="roam evaluate load")


def rigs(context: typer.Context) -> None:
    """Bones of foreign characters, and how exactly poses arrive on them (`--help` lists its options)."""
    delegate("roam_evaluation.character.rigs", context.args, name="roam evaluate rigs")


def uploads(context: typer.Context) -> None:
    """Files of known size and turning, uploaded with nothing said: right, doubted, refused or silently wrong."""
    delegate("roam_evaluation.uploads.reading", context.args, name="roam evaluate uploads")
