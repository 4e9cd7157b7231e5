"""`roam serve`: both services in one process, until Ctrl-C."""

import sys
from enum import StrEnum
from typing import Annotated

import typer

from roam_command.embedded import make_services
from roam_command.reports import reported


class Only(StrEnum):
    """One of the services."""

    GOALPOSE = "goalpose"
    MOTION = "motion"


def serve(
    host: Annotated[str, typer.Option("--host", help="Address to listen on.")] = "127.0.0.1",
    http_port: Annotated[
        int, typer.Option("--http-port", min=0, max=65535, help="HTTP port; 0 takes a free one.")
    ] = 8080,
    grpc_port: Annotated[
        int, typer.Option("--grpc-port", min=0, max=65535, help="gRPC port; 0 takes a free one.")
    ] = 50051,
    only: Annotated[Only | None, typer.Option("--only", help="Run one of the services only.")] = None,
) -> None:
    """Run both services; prints `ready http=… grpc=…` when they are, logs to stderr.

    Everything else is set by ROAM_… environment variables; `python -m roam_goalpose.app --help` lists them.
    """
    with reported(as_json=False):
        # A person reads the log at a terminal, a collector reads it anywhere else.
        format = {"log_format": "console"} if sys.stderr.isatty() else {}
        services, settings = make_services(
            "`roam serve`", host=host, http_port=http_port, grpc_port=grpc_port, **format
        )
    from roam_serving.server import serve as run

    run([service for service in services if only is None or service.name == only], settings)
