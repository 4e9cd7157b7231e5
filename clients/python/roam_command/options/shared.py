"""Options that several commands share."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from roam_client import Action
from roam_client.types.objects import format_of

from roam_command.reports import UsageError


class ActionName(StrEnum):
    """What to do with the object."""

    SIT = "sit"
    LIE = "lie"

    @property
    def action(self) -> Action:
        """The protocol's action."""
        return Action.SIT if self is ActionName.SIT else Action.LIE


ObjectArgument = Annotated[
    Path, typer.Argument(metavar="OBJECT", help="Furniture file: obj, glb, gltf, ply, stl, off, xyz, pcd or npy.")
]
ReferenceOption = Annotated[
    str | None,
    typer.Option(
        "--reference", metavar="ID", help="Reference pose to adapt: chair_sit, sofa_sit, sofa_lie, … (default: chosen)."
    ),
]
ActionOption = Annotated[ActionName, typer.Option("--action", help="What to do, when no --reference is given.")]
SeedOption = Annotated[
    int, typer.Option("--seed", min=0, help="The same request with the same seed gives the same answer.")
]
UnitOption = Annotated[
    str | None, typer.Option("--unit", metavar="m|cm|mm|in|ft", help="Unit of the file (default: detected).")
]
UpOption = Annotated[
    str | None, typer.Option("--up", metavar="x|y|z|-x|-y|-z", help="Up axis of the file (default: detected).")
]
ScaleOption = Annotated[
    float | None,
    typer.Option("--scale", metavar="METRES", help="Height of the object in metres (default: as its unit says)."),
]
PieceOption = Annotated[
    str | None,
    typer.Option("--piece", metavar="NAME|INDEX", help="Which one of a file of several (default: the best seat)."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object.")]
OutputOption = Annotated[
    list[Path] | None, typer.Option("-o", "--output", metavar="FILE", help="Where to save; may be given several times.")
]


@dataclass(frozen=True)
class Wish:
    """What a character is to do with an object, and how the object's file is read."""

    reference: ReferenceOption = None
    action: ActionOption = ActionName.SIT
    seed: SeedOption = 0
    unit: UnitOption = None
    up: UpOption = None
    scale: ScaleOption = None
    piece: PieceOption = None


@dataclass(frozen=True)
class ServerChoice:
    """Which servers to use, and what to show them."""

    server: Annotated[
        str | None,
        typer.Option(
            "--server",
            metavar="ADDRESS",
            help="gRPC address of running services: host:port when one process serves both, "
            "or goalpose=host:port,motion=host:port. Without it the command starts its own.",
        ),
    ] = None
    api_key: Annotated[
        str | None,
        typer.Option("--api-key", envvar="ROAM_API_KEY", show_envvar=True, help="Key that the servers ask for."),
    ] = None
    ca: Annotated[
        Path | None, typer.Option("--ca", metavar="FILE", help="Authority of the servers' certificates (PEM): use TLS.")
    ] = None
    cert: Annotated[
        Path | None, typer.Option("--cert", metavar="FILE", help="Own certificate (PEM), for mutual TLS.")
    ] = None
    cert_key: Annotated[
        Path | None, typer.Option("--cert-key", metavar="FILE", help="Private key of --cert (PEM).")
    ] = None

    @property
    def security(self) -> dict[str, Any]:
        """The arguments of `Client` that say the same. UsageError when they do not fit together."""
        if (self.cert is None) != (self.cert_key is None):
            raise UsageError("--cert and --cert-key belong together", remedy="Give both files.")
        pair = None if self.cert is None or self.cert_key is None else (self.cert, self.cert_key)
        return {"api_key": self.api_key, "ca": self.ca, "cert": pair}


def checked_object(path: Path) -> Path:
    """The object file, or a UsageError or FormatError before any server is started."""
    if not path.is_file():
        raise UsageError(f"there is no file {path}", remedy="Check the path; `roam demo` shows a bundled chair.")
    format_of(path)
    return path


def checked_outputs(paths: list[Path] | None, endings: tuple[str, ...]) -> list[Path]:
    """The files to write, checked before any work is done."""
    for path in paths or []:
        if path.suffix.lower() not in endings:
            known = ", ".join(endings)
            raise UsageError(
                f"cannot write {path.name}: its ending says no known format", remedy=f"Use one of {known}."
            )
        if not path.parent.is_dir():
            raise UsageError(f"there is no folder {path.parent}", remedy="Make it first, or choose another one.")
    return paths or []
