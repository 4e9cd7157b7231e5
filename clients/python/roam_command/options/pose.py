"""Options of `roam pose` that ask for more than a pose that fits."""

from dataclasses import dataclass
from math import isfinite, radians
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from roam_client import Action, Client, Pose, PoseWishes

from roam_command.reports import UsageError

STATURE = 1.69  # [m] of the default skeleton
_POINT = "X,Y,Z"


@dataclass(frozen=True)
class Extras:
    """Constraints, body size, weights, own reference, several poses."""

    count: Annotated[int, typer.Option("--count", min=1, help="Poses wanted: the best, and others unlike it.")] = 1
    seat: Annotated[
        str | None, typer.Option("--seat", metavar=_POINT, help="Point in metres that the hips shall go over.")
    ] = None
    facing: Annotated[
        float | None, typer.Option("--facing", metavar="DEGREES", help="Heading of the hips about +Y; 0 faces +Z.")
    ] = None
    left_hand: Annotated[
        str | None, typer.Option("--left-hand", metavar=_POINT, help="Point in metres for the left hand.")
    ] = None
    right_hand: Annotated[
        str | None, typer.Option("--right-hand", metavar=_POINT, help="Point in metres for the right hand.")
    ] = None
    height: Annotated[
        float | None, typer.Option("--height", min=0.8, max=2.4, help=f"Height of the person [m]; default {STATURE}.")
    ] = None
    weight: Annotated[
        list[str] | None,
        typer.Option("--weight", metavar="TERM=VALUE", help="Weight of an energy term, 0 for off; may be repeated."),
    ] = None
    like: Annotated[
        Path | None, typer.Option("--like", metavar="POSE.npz", help="Adapt this pose, which is on --like-object.")
    ] = None
    like_object: Annotated[
        Path | None, typer.Option("--like-object", metavar="FILE", help="Furniture that the pose of --like is on.")
    ] = None

    def check(self) -> None:
        """UsageError before any work when options do not make sense."""
        if (self.like is None) != (self.like_object is None):
            raise UsageError("--like and --like-object belong together", remedy="Give both files.")
        for path in (self.like, self.like_object):
            if path is not None and not path.is_file():
                raise UsageError(f"there is no file {path}", remedy="Check the path.")
        self._points()
        self._weights()

    def wishes(self, client: Client) -> PoseWishes:
        """What `Client.synthesize` takes; a person of another height is the server's default one, scaled."""
        return PoseWishes(
            facing=None if self.facing is None else radians(self.facing),
            weights=self._weights(),
            skeleton=None if self.height is None else client.skeleton().sized(self.height / STATURE),
            **self._points(),
        )

    def reference(self, client: Client, action: Action) -> str | None:
        """The name of the reference pose that --like makes, if it was given."""
        if self.like is None or self.like_object is None:
            return None
        with np.load(self.like) as file:
            pose = Pose("", file["root_position"], file["rotations"])
        return client.create_reference(client.upload(self.like_object), pose, action=action, title=self.like.stem).name

    def _points(self) -> dict[str, Any]:
        given = {"seat_point": self.seat, "left_hand": self.left_hand, "right_hand": self.right_hand}
        return {name: _point(text) for name, text in given.items() if text is not None}

    def _weights(self) -> dict[str, float]:
        found = {}
        for text in self.weight or []:
            term, _, value = text.partition("=")
            found[term] = _number(value, f"--weight {text}", "TERM=VALUE, for example descriptor=0")
        return found


def _point(text: str) -> tuple[float, float, float]:
    numbers = [_number(part, text, f"three numbers {_POINT} in metres") for part in text.split(",")]
    if len(numbers) != 3:
        raise UsageError(f"{text!r} is no point", remedy=f"Write three numbers {_POINT} in metres.")
    return numbers[0], numbers[1], numbers[2]


def _number(text: str, whole: str, wanted: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise UsageError(f"cannot read {whole!r}", remedy=f"Write {wanted}.")
    return value
