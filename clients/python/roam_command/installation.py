"""What of the product is installed here: the client alone, or the services and the files that come with them."""

import importlib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from roam_command.reports import UsageError

DEFAULT_OBJECT = "chair"
# How a sentence about a missing part ends.
INSTALL = "install the services: scripts/install in a checkout, or roam-services in the place of roam-services-client"


def services_module(module: str, *, wanted_by: str) -> Any:
    """A module of the services. UsageError that names the command when they, or a package they need, are missing."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        missing = error.name or module
        if missing.startswith("roam_"):
            raise UsageError(
                f"{wanted_by} computes in this process, and the services are not installed here ({missing} is missing)",
                remedy=f"Use a running server with --server host:port, or {INSTALL}.",
            ) from error
        raise UsageError(
            f"{wanted_by} needs {missing}, which is not installed here",
            remedy="pip install 'roam-services[evaluation]' has what measuring and training need.",
        ) from error


def bundled_objects() -> dict[str, Path]:
    """The furniture that comes with the services, by name; empty where only the client is installed."""
    if find_spec("roam_serving") is None:
        return {}
    from roam_serving.shipped import OBJECTS

    return {path.stem: path for path in sorted(OBJECTS.glob("*.glb"))}


def bundled_object(name: str) -> Path:
    """One of them. UsageError when there is none of this name."""
    objects = bundled_objects()
    if name not in objects:
        raise UsageError(f"no bundled object {name}", remedy="Give a furniture file: roam demo OBJECT.")
    return objects[name]
