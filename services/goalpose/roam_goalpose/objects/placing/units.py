"""Which unit a file's numbers are in: metres, centimetres, millimetres, inches or feet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from roam_goalpose.objects.errors import ObjectError

if TYPE_CHECKING:
    from roam_goalpose.objects.placing.size import Size

METRES_PER: Mapping[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
_ALIASES: Mapping[str, str] = {
    "metre": "m",
    "metres": "m",
    "meter": "m",
    "meters": "m",
    "centimetre": "cm",
    "centimetres": "cm",
    "centimeter": "cm",
    "centimeters": "cm",
    "millimetre": "mm",
    "millimetres": "mm",
    "millimeter": "mm",
    "millimeters": "mm",
    "inch": "in",
    "inches": "in",
    "foot": "ft",
    "feet": "ft",
}

# Longest edge of furniture one can sit or lie on [m]: a footstool … a corner sofa or a set of a few pieces.
SMALLEST, LARGEST = 0.25, 5.0
# How often files come in each unit when nothing says it: of 108 originals of furniture libraries whose real size is
# known, 25 % were in metres within a third, 73 % in centimetres; scans are in metres, CAD in millimetres. "" is no unit
# at all: a model that its author scaled as it pleased (45 % of the game libraries).
_PRIORS: Mapping[str, float] = {"m": 0.45, "cm": 0.25, "mm": 0.12, "in": 0.05, "ft": 0.03, "": 0.10}
_ANY_SCALE = 1 / (2 * math.log(10))  # density of a scale between a tenth and ten times a unit's
_LEAST_DEVIATION = 0.17  # of log heights: that of the held-out objects in size_fit
_SURE = 0.9  # below this the second reading is told
_DECLARED_FAR = 0.6  # e-folds from the expected height (a factor of 1.8) that make a declared unit doubtful


@dataclass(frozen=True)
class UnitGuess:
    """The metres in a file's unit, its name if it has one, and how sure we are (`doubt` is empty or a sentence)."""

    unit: str
    metres: float
    doubt: str


def check_unit(name: str) -> str:
    """The canonical unit name (`m cm mm in ft`); raises OBJECT_UNIT_UNKNOWN."""
    unit = _ALIASES.get(name.strip().lower(), name.strip().lower())
    if unit not in METRES_PER:
        raise ObjectError(
            "OBJECT_UNIT_UNKNOWN",
            field="unit",
            message=f"The unit {name[:40]!r} is not known.",
            remedy=f"Give one of {', '.join(METRES_PER)}, or leave it out to have it detected.",
        )
    return unit


def check_size(height: float) -> float:
    """A height in metres that a sender gives; raises OBJECT_SIZE_IMPLAUSIBLE."""
    if not (math.isfinite(height) and 0.05 <= height <= LARGEST):
        raise ObjectError(
            "OBJECT_SIZE_IMPLAUSIBLE",
            field="size",
            message=f"The given height of {height:.4g} m is not one that furniture has.",
            remedy=f"Give the object's height in metres, 0.05 to {LARGEST:g}.",
        )
    return height


def given_unit(extent: float, unit: str) -> UnitGuess:
    """What the sender says, unless the object would not be furniture-sized: OBJECT_SIZE_IMPLAUSIBLE."""
    unit = check_unit(unit)
    if not plausible(extent * METRES_PER[unit]):
        message = f"The object's longest edge is {extent * METRES_PER[unit]:.4g} m if the unit is {unit}"
        raise _implausible(message, "Give another unit, leave it out to have it detected, or scale the object.")
    return UnitGuess(unit, METRES_PER[unit], "")


def declared_unit(extent: float, height: float, metres: float, expected: Size | None) -> UnitGuess:
    """What the file says, believed; an absurd size is refused, an unusual one told."""
    if not plausible(extent * metres):
        said = f"The file says that its unit is {_length(metres)}"
        message = f"{said}, which makes the object's longest edge {extent * metres:.4g} m"
        raise _implausible(message, "Scale it to its real size, or give its height in metres (size) or the unit.")
    unit = next((name for name, size in METRES_PER.items() if math.isclose(size, metres, rel_tol=1e-6)), "")
    apart = 0.0 if expected is None else math.log(height * metres) - expected.log_height
    if expected is None or abs(apart) < max(_DECLARED_FAR, 3 * expected.deviation):
        return UnitGuess(unit, metres, "")
    doubt = (
        f"The file says that its unit is {_length(metres)}: the object is then {height * metres:.2f} m high. "
        f"For a body to use it, it should be about {expected.height:.2f} m high; give its height (size) if that is so."
    )
    return UnitGuess(unit, metres, doubt)


def too_large(extent: float, metres: float, pieces: str) -> ObjectError:
    """The refusal of a room: what it is in metres, and what in it can be chosen."""
    named = f" It holds {pieces}." if pieces else ""
    message = f"The object's longest edge is {extent:.4g} m (one unit is {_length(metres)})"
    remedy = (
        "Choose one of its pieces (piece)." if pieces else "Send one piece of furniture, or give its height (size)."
    )
    error = _implausible(message, remedy)
    return ObjectError(error.reason, field=error.field, message=error.message + named, remedy=remedy)


def choose_unit(extent: float, height: float, expected: Size) -> UnitGuess:
    """The unit of a file that says nothing.

    Args:
        extent: longest edge of the box, in the file's numbers.
        height: of the object on its feet, in the file's numbers.
        expected: what its shape says about its height.

    Raises:
        ObjectError: OBJECT_SIZE_IMPLAUSIBLE when no unit makes it furniture.
    """
    readings = {unit: metres for unit, metres in METRES_PER.items() if plausible(extent * metres)}
    if not readings:
        raise _implausible(
            f"The object's longest edge is {extent:.4g} in the file's numbers, which is in every usual unit",
            "Give its height in metres (size) or the unit, or scale it to its real size; check for stray vertices.",
        )
    deviation = max(expected.deviation, _LEAST_DEVIATION)
    weights = {
        unit: _PRIORS[unit] * _density((math.log(height * metres) - expected.log_height) / deviation) / deviation
        for unit, metres in readings.items()
    }
    weights[""] = _PRIORS[""] * _ANY_SCALE
    readings[""] = min(max(expected.height / height, SMALLEST / extent), LARGEST / extent)
    ranked = sorted(weights, key=lambda unit: -weights[unit])
    best, second = ranked[0], ranked[1]
    sure = weights[best] / sum(weights.values())
    if best and sure > _SURE:
        return UnitGuess(best, readings[best], "")
    told = (
        f"Nothing says the file's unit: it was {_reading(best, height, readings[best])}, "
        f"but it may be {_reading(second, height, readings[second])}; give the unit, or its height (size), to be sure."
    )
    return UnitGuess(best, readings[best], told)


def plausible(metres: float) -> bool:
    """Whether a longest edge of so many metres can be furniture."""
    return SMALLEST <= metres <= LARGEST


def _density(z: float) -> float:
    """Student's t with four degrees of freedom: real furniture has tails."""
    return 0.375 / (1 + z * z / 4) ** 2.5


def _reading(unit: str, height: float, metres: float) -> str:
    how = f"taken as {unit}" if unit else "scaled to what a body can use"
    return f"{how} ({height * metres:.2f} m high)"


def _length(metres: float) -> str:
    return next(
        (name for name, size in METRES_PER.items() if math.isclose(size, metres, rel_tol=1e-6)), f"{metres:.4g} m"
    )


def _implausible(message: str, remedy: str) -> ObjectError:
    limits = f"{SMALLEST} to {LARGEST:g} m"
    return ObjectError("OBJECT_SIZE_IMPLAUSIBLE", field="unit", message=f"{message}, not {limits}.", remedy=remedy)
