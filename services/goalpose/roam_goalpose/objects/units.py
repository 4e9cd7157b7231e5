"""Which unit a file's numbers are in: metres, centimetres, millimetres, inches or feet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from roam_goalpose.objects.errors import ObjectError

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

# Largest extent of furniture one can sit or lie on [m]: a footstool … a corner sofa or a scene of a few pieces.
SMALLEST, LARGEST = 0.25, 5.0
# Most pieces are about this long; the spread (in e-folds) covers a 0.5 m stool and a 2.4 m sofa within two.
_TYPICAL, _SPREAD = 1.1, 0.5
# How often files come in each unit when the format does not say. Feet cannot be told from metres: never guessed.
_PRIORS: Mapping[str, float] = {"m": 0.70, "cm": 0.17, "mm": 0.11, "in": 0.02}
_CLEAR = 5.0  # the best guess must be this many times as likely as the next to go without a warning


@dataclass(frozen=True)
class UnitGuess:
    """A unit, the metres in it, and how sure we are (`doubt` is empty or a sentence)."""

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


def choose_unit(extent: float, *, given: str | None, hint: str | None) -> UnitGuess:
    """The unit of a file whose longest box edge is `extent` [file units].

    Args:
        extent: longest edge of the axis-aligned box, in the file's numbers.
        given: what the sender says; it is believed unless the object would not be furniture-sized.
        hint: what the format's specification says (glTF: metres); taken whenever it is plausible.

    Raises:
        ObjectError: OBJECT_UNIT_UNKNOWN, OBJECT_SIZE_IMPLAUSIBLE.
    """
    if given is not None:
        unit = check_unit(given)
        if not plausible(extent * METRES_PER[unit]):
            raise _implausible(extent, unit)
        return UnitGuess(unit, METRES_PER[unit], "")
    if hint is not None and plausible(extent * METRES_PER[hint]):
        return UnitGuess(hint, METRES_PER[hint], "")
    weights = {unit: prior * _likelihood(extent * METRES_PER[unit]) for unit, prior in _PRIORS.items()}
    ranked = sorted(weights, key=lambda unit: -weights[unit])
    best, second = ranked[0], ranked[1]
    if weights[best] == 0.0:
        raise _implausible(extent, None)
    doubt = ""
    if weights[second] * _CLEAR > weights[best]:
        doubt = (
            f"The file's longest edge is {extent:.4g}: taken as {best} ({extent * METRES_PER[best]:.2f} m), "
            f"but {second} ({extent * METRES_PER[second]:.2f} m) is possible; give the unit to be sure."
        )
    return UnitGuess(best, METRES_PER[best], doubt)


def plausible(metres: float) -> bool:
    """Whether a longest edge of so many metres can be furniture."""
    return SMALLEST <= metres <= LARGEST


def _likelihood(metres: float) -> float:
    if not plausible(metres):
        return 0.0
    return math.exp(-0.5 * (math.log(metres / _TYPICAL) / _SPREAD) ** 2)


def _implausible(extent: float, unit: str | None) -> ObjectError:
    limits = f"{SMALLEST} to {LARGEST:g} m"
    if unit is None:
        message = f"The object's longest edge is {extent:.4g} in the file's numbers: no usual unit makes that {limits}."
        remedy = "Give the unit (m, cm, mm, in, ft), or scale the object to its real size; check for stray vertices."
    else:
        message = f"The object's longest edge is {extent * METRES_PER[unit]:.4g} m if the unit is {unit}, not {limits}."
        remedy = "Give another unit, leave it out to have it detected, or scale the object to its real size."
    return ObjectError("OBJECT_SIZE_IMPLAUSIBLE", field="unit", message=message, remedy=remedy)
