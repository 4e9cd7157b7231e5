"""`roam train field|motion`: the training programs with which the shipped weights were made."""

import typer

from roam_command.delegation import delegate


def field(context: typer.Context) -> None:
    """Train the descriptor field on procedural and real furniture (`--help` lists its options)."""
    delegate("roam_goalpose.training.field", context.args, name="roam train field")


def motion(context: typer.Context) -> None:
    """Train the motion network on motion capture (`--help` lists its options)."""
    delegate("roam_motion.training.motion", context.args, name="roam train motion")
