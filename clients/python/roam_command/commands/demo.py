"""`roam demo [OBJECT]`: both services and a page on which a person sees them work."""

import signal
import threading
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from roam_command.installation import DEFAULT_OBJECT, bundled_object
from roam_command.options.shared import UnitOption, UpOption, checked_object
from roam_command.reports import reported, stderr


def demo(
    object: Annotated[
        Path | None, typer.Argument(metavar="[OBJECT]", help="Furniture file (default: a bundled chair).")
    ] = None,
    unit: UnitOption = None,
    up: UpOption = None,
    host: Annotated[str, typer.Option("--host", help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port of the page; 0 takes a free one.")] = 8088,
    open_browser: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in a browser.")] = False,
) -> None:
    """Show a page: the object, the pose settling on it, the character walking up, live from the services."""
    with reported(as_json=False):
        from roam_command.embedded import make_services, running_in_thread

        services, settings = make_services("`roam demo`", host=host, http_port=port, grpc_port=0)
        from roam_command.page import PageService, Upload

        source = checked_object(object) if object is not None else bundled_object(DEFAULT_OBJECT)
        stderr.print("loading the models …", style="dim")
        page = PageService(Upload(source, unit=unit, up=up))
        with running_in_thread([*services, page], settings) as addresses:
            typer.echo(f"demo: {addresses.http}/")
            stderr.print("Ctrl-C ends it.", style="dim")
            if open_browser:
                webbrowser.open(addresses.http)
            wait_for_end()


def wait_for_end() -> None:
    """Until Ctrl-C or SIGTERM; both end the services properly."""
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    stop.wait()
