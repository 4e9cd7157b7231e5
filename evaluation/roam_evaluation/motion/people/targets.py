"""What is asked of the product beyond people's ranges: figures with a limit of their own, and whether they are kept."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from roam_evaluation.motion.people.frames import RATE, Motion
from roam_evaluation.motion.people.measures import feet, lying, sitting, turning
from roam_evaluation.motion.people.measures.posture import twist
from roam_evaluation.motion.people.performed import GOING

_HELD = 0.10  # share by which a told speed may be missed
_TWIST = 75.0  # [degrees]
_LEAN = (39.0, 67.0)  # [degrees] people's 5th and 95th percentile
_LEANING, _BALANCED = 80.0, 90.0  # [%] of sits
_SLIDE = 0.5  # [cm] per contact
_SLOWEST = 60  # frames of a steered walk until its speed counts


@dataclass(frozen=True)
class Target:
    """One figure and its limit."""

    title: str
    value: float
    unit: str
    limit: str
    kept: bool


def targets(motions: Sequence[Motion], balance: tuple[float, float] | None) -> list[Target]:
    """All that the motions allow to be measured. `balance`: people's 5th and 95th percentile of the centre of mass
    ahead of the rear ankle half-way down [cm]."""
    return [*_speeds(motions), *_turns(motions), *_sits(motions, balance), *_contacts(motions), *_lies(motions)]


def _speeds(motions: Sequence[Motion]) -> list[Target]:
    found = []
    told = sorted({float(m.told.split()[1]) for m in motions if m.told.startswith("steer ")})
    for speed in told:
        held = [_held(m) for m in motions if m.told == f"steer {speed:g}"]
        value = float(np.median(held))
        kept = abs(value / speed - 1) <= _HELD
        found.append(Target(f"speed held when told {speed:g} m/s", value, "m/s", f"{speed:g} ± 10 %", kept))
    return found


def _held(motion: Motion) -> float:
    """Speed of the hips once it should be held [m/s]."""
    track = motion.hips[GOING.start + _SLOWEST : GOING.stop, [0, 2]]
    return float(np.linalg.norm(track[-1] - track[0])) * RATE / (len(track) - 1)


def _turns(motions: Sequence[Motion]) -> list[Target]:
    found = [turn for m in motions if m.told.startswith("turn ") for turn in turning.turns(m)]
    if not found:
        return []
    value = float(np.nanquantile(np.concatenate([twist(turn.motion).ravel() for turn in found]), 0.99))
    return [Target("foot-pelvis twist while turning, 99 % of frames", value, "°", "<= 75", value <= _TWIST)]


def _sits(motions: Sequence[Motion], balance: tuple[float, float] | None) -> list[Target]:
    asked = [m for m in motions if m.told == "sit"]
    if not asked:
        return []
    rows = [row for m in asked for sit in sitting.sits(m) if (row := sitting.measure_down(sit))]
    arrived = 100 * float(np.mean([bool(sitting.sits(m)) for m in asked]))
    out = [Target("goal poses reached within 5 cm", arrived, "%", "100", arrived == 100.0)]
    if rows:
        leaning = 100 * float(np.mean([_LEAN[0] <= row["lean_down"] <= _LEAN[1] for row in rows]))
        title = "sits with a forward lean of 39 to 67 degrees"
        out.append(Target(title, leaning, "%", ">= 80", leaning >= _LEANING))
    if rows and balance:
        held = 100 * float(np.mean([balance[0] <= row["balance_half_down"] <= balance[1] for row in rows]))
        title = "sits with the centre of mass within people's range half-way down"
        out.append(Target(title, held, "%", ">= 90", held >= _BALANCED))
    return out


def _contacts(motions: Sequence[Motion]) -> list[Target]:
    rows = [feet.measure(m) for m in motions if m.told.startswith(("steer ", "sit"))]
    values = [row["slide"] for row in rows if row and np.isfinite(row["slide"])]
    if not values:
        return []
    value = float(np.mean(values))
    return [Target("slide per contact, by height and speed", value, "cm", "<= 0.5", value <= _SLIDE)]


def _lies(motions: Sequence[Motion]) -> list[Target]:
    found = [d for m in motions for lie in lying.held(m) if (d := lying.reversal(m, lie)) is not None]
    if not found:
        return []
    value = float(np.median(found))
    title = "getting up, from lying down played backwards: mean distance of joints"
    return [Target(title, value, "cm", "> 5", value > 5.0)]
