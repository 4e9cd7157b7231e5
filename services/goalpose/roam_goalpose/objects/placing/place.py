"""From a file's numbers to metres, +Y up: what is given is obeyed, what is declared is believed, the rest is found."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from roam_goalpose.objects.geometry import Array, Geometry
from roam_goalpose.objects.placing.axes import up_rotation
from roam_goalpose.objects.placing.size import Size, describe_shape, expected_size
from roam_goalpose.objects.placing.tilt import FARTHEST, Tilt, find_tilt, stands, surface_centre
from roam_goalpose.objects.placing.units import UnitGuess, choose_unit, declared_unit, given_unit
from roam_goalpose.objects.placing.upright import choose_up, score_turned
from roam_goalpose.objects.shape import ShapeWarning
from roam_goalpose.objects.surfaces.surface import surface_samples

_CANDIDATES = ("y", "z")  # what programs write; anything else must be given, or is found as a tilt
_CLOUD_POINTS = 20_000
_CLOUD_TOUCH = 0.03  # [m]: what touches the floor in a scan, with its noise


@dataclass(frozen=True, eq=False)
class Placing:
    """How file coordinates become the world: `world = metres · rotation @ file`."""

    metres: float
    rotation: Array  # [3, 3]
    warnings: tuple[ShapeWarning, ...]


@dataclass(frozen=True, eq=False)
class _Standing:
    """An object with one axis up: the turn, how tall it is in file units, and how tall it should be [m]."""

    rotation: Array
    height: float
    expected: Size

    @property
    def scale(self) -> float:
        return self.expected.height / self.height


def place(
    geometry: Geometry, *, unit: str | None, up: str | None, size: float | None, level: Array | None = None
) -> Placing:
    """Unit and axes of an object.

    Args:
        geometry: in the file's numbers.
        unit: `m cm mm in ft` if the sender says it.
        up: `y z x -x …` if the sender says it.
        size: height in metres if the sender says it; goes before the unit.
        level: `[3]` direction in the file that a floor under the object shows to be up.

    Raises:
        ObjectError: OBJECT_SIZE_IMPLAUSIBLE.
    """
    samples = surface_samples(geometry)
    extent = float(np.ptp(geometry.vertices, axis=0).max())
    warnings: list[ShapeWarning] = []
    fixed = up or geometry.up
    if fixed is None and level is not None:
        standing = _standing(*samples, _turn_to_up(level))
    elif fixed is not None:
        standing = _standing(*samples, up_rotation(fixed))
    else:
        standing, doubt = _choose(*samples, known=None if size else _known_scale(extent, geometry, unit))
        if doubt:
            warnings.append(ShapeWarning("OBJECT_UP_UNSURE", doubt))
    tilt = _tilt(geometry, samples, standing, farthest=FARTHEST if fixed or level is not None else math.pi)
    if tilt is not None:
        turned = tilt.sure and up is None
        warnings = [*(() if turned else warnings), _leaning(tilt, turned=turned)]
        if turned:
            standing = _standing(*samples, tilt.turn @ standing.rotation)
    guess = _unit(extent, geometry, standing, unit=unit, size=size)
    if guess.doubt:
        warnings.append(ShapeWarning("OBJECT_UNIT_UNSURE", guess.doubt))
    return Placing(guess.metres, standing.rotation, tuple(warnings))


def likely_up(geometry: Geometry) -> str:
    """The axis that seems up in a geometry that says nothing."""
    samples = surface_samples(geometry)
    standing, _ = _choose(*samples, known=geometry.metres)
    return next(axis for axis in _CANDIDATES if np.array_equal(standing.rotation, up_rotation(axis)))


def _unit(extent: float, geometry: Geometry, standing: _Standing, *, unit: str | None, size: float | None) -> UnitGuess:
    if size is not None:
        return UnitGuess("", size / standing.height, "")
    if unit is not None:
        return given_unit(extent, unit)
    if geometry.metres is not None:
        return declared_unit(extent, standing.height, geometry.metres, standing.expected)
    return choose_unit(extent, standing.height, standing.expected)


def _known_scale(extent: float, geometry: Geometry, unit: str | None) -> float | None:
    """Metres in the file's unit where something says them."""
    return given_unit(extent, unit).metres if unit is not None else geometry.metres


def _standing(points: Array, normals: npt.NDArray[np.floating], rotation: Array) -> _Standing:
    height = max(float(np.ptp(points @ rotation[1])), 1e-9)
    return _Standing(rotation, height, expected_size(describe_shape(points, normals, rotation)))


def _choose(points: Array, normals: npt.NDArray[np.floating], *, known: float | None) -> tuple[_Standing, str]:
    """Whether Y or Z is up: each at the size that it should then have, unless the size is known."""
    found = {axis: _standing(points, normals, up_rotation(axis)) for axis in _CANDIDATES}
    scores = {axis: score_turned(points * (known or one.scale), normals, one.rotation) for axis, one in found.items()}
    guess = choose_up(scores)
    return found[guess.up], guess.doubt


def _tilt(
    geometry: Geometry, samples: tuple[Array, npt.NDArray[np.floating]], standing: _Standing, *, farthest: float
) -> Tilt | None:
    """What is missing for an object to stand; None when it stands."""
    points, normals = samples
    scale = standing.scale
    if geometry.faces is None:
        vertices = points[:_CLOUD_POINTS] @ standing.rotation.T * scale
        centre, touch = vertices.mean(axis=0), _CLOUD_TOUCH
    else:
        vertices = geometry.vertices @ standing.rotation.T * scale
        centre, touch = standing.rotation @ surface_centre(geometry.triangles, geometry.areas) * scale, None
    if stands(vertices, centre, touch=touch):
        return None
    turned = points @ standing.rotation.T * scale, normals @ standing.rotation.T
    return find_tilt(vertices, *turned, centre=centre, farthest=farthest, touch=touch)


def _leaning(tilt: Tilt, *, turned: bool) -> ShapeWarning:
    told = f"The object does not stand: it leans by {math.degrees(tilt.angle):.0f}°. "
    told += "It was set on its feet." if turned else "It was left so; set it on its feet if it should stand."
    return ShapeWarning("OBJECT_TILTED", told)


def _turn_to_up(level: Array) -> Array:
    """The turn that takes a direction to +Y; that of the axis convention where the direction is an axis."""
    for axis in ("y", "z", "x", "-y", "-z", "-x"):
        rotation = up_rotation(axis)
        if float(rotation[1] @ level) > 1 - 1e-4:
            return rotation
    from roam_goalpose.objects.placing.tilt import turn_to_y

    return turn_to_y(level)
