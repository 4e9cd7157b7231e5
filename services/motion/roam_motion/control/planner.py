"""The planned root path of the next two seconds: the goals that the network follows in locomotion.

A simulated root with smooth velocity and turning walks ahead of the character: along a way to a target, or at a wanted
velocity. At a wanted velocity it needs no simulation but for the turning, so that all characters are planned at once;
on a way two dozen small steps follow one another, which plain Python numbers in a loop take quickest.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from roam_motion.animation.state import KEYS
from roam_motion.control.paths import Place

_STEP = 1 / 12  # [s] of the simulation; a key is two steps
SPEED = 1.25  # [m/s] walking: people cross a room at 1.2 to 1.4
_BRAKE = 0.7  # [m/s2] before the end of the way; tuned on approaches: at 0.9 feet come too near to the seat
_AGILITY = 0.25, 0.15  # [s] time constants of velocity and turn rate
_TURN = 1.7  # [rad/s] fastest turn: at 2.2 feet are twisted by more than people's 73 degrees (p99) on approaches
_TURN_GAIN = 3.5  # [1/s]
_NEAR = 0.55  # [m] from the target the figure turns to its final facing
_AHEAD = 0.3  # [m] along its way that the figure looks: corners are cut by a hand's breadth
_ROUND = 2 * math.pi
_STEPS = 2 * (KEYS - 1)  # of the simulation until the last key

Wanted = Callable[[float, float, float], tuple[float, float, float]]  # x, z, yaw -> wanted velocity and yaw
Leg = tuple[float, float, float, float, float]  # of a way: start, direction, length


class Plan(NamedTuple):
    """A simulated root: place, velocity, yaw, yaw rate."""

    x: float
    z: float
    vx: float = 0.0
    vz: float = 0.0
    yaw: float = 0.0
    rate: float = 0.0


@dataclass(frozen=True)
class Target:
    """Where to stand: place, yaw; and the corners of the way there, both ends included (see paths.py)."""

    x: float
    z: float
    yaw: float
    way: tuple[Place, ...]
    speed: float = SPEED  # [m/s] at most


@dataclass(frozen=True)
class Steering:
    """A wanted velocity and yaw (None: along the velocity, or as it is when standing)."""

    vx: float
    vz: float
    yaw: float | None


def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % _ROUND - math.pi


Aim = Target | Steering


def advance_plan(plan: Plan, aim: Aim, seconds: float) -> Plan:
    """The plan a little later."""
    wanted = _steered(aim) if isinstance(aim, Steering) else _guided(aim)
    return Plan(*_later(*plan, wanted, seconds, *_shares(seconds)))


def plan_keys(plans: Sequence[Plan], aims: Sequence[Aim]) -> tuple[np.ndarray, np.ndarray]:
    """Planned places [B, 13, 2] and directions [B, 13, 2] at 0, 1/6, … 2 s, the same in any company."""
    keys = np.empty((len(plans), 3, KEYS))
    steered = {row: aim for row, aim in enumerate(aims) if isinstance(aim, Steering)}
    if steered:
        keys[list(steered)] = _steered_keys([plans[row] for row in steered], list(steered.values()))
    for row, aim in enumerate(aims):
        if isinstance(aim, Target):
            keys[row] = _guided_keys(plans[row], aim)
    places, yaw = keys[:, :2].swapaxes(1, 2), np.ascontiguousarray(keys[:, 2])
    return places.astype(np.float32), np.stack([np.sin(yaw), np.cos(yaw)], -1).astype(np.float32)


def _shares(seconds: float) -> tuple[float, float]:
    """How much velocity and turn rate come nearer to what is wanted in so many seconds."""
    soft, turning = (1 - math.exp(-seconds / constant) for constant in _AGILITY)
    return soft, turning


def _later(
    x: float,
    z: float,
    vx: float,
    vz: float,
    yaw: float,
    rate: float,
    wanted: Wanted,
    seconds: float,
    soft: float,
    turning: float,
) -> tuple[float, float, float, float, float, float]:
    """The numbers of a plan after one step."""
    to_vx, to_vz, to_yaw = wanted(x, z, yaw)
    to_rate = _TURN_GAIN * ((to_yaw - yaw + math.pi) % _ROUND - math.pi)
    to_rate = _TURN if to_rate > _TURN else -_TURN if to_rate < -_TURN else to_rate
    vx += (to_vx - vx) * soft
    vz += (to_vz - vz) * soft
    rate += (to_rate - rate) * turning
    yaw = (yaw + rate * seconds + math.pi) % _ROUND - math.pi
    return x + vx * seconds, z + vz * seconds, vx, vz, yaw, rate


def _guided_keys(plan: Plan, aim: Target) -> np.ndarray:
    """x, z and yaw at the keys [3, 13]."""
    wanted, shares = _guided(aim), _shares(_STEP)
    numbers: tuple[float, float, float, float, float, float] = plan
    keys = [(plan.x, plan.z, plan.yaw)]
    for step in range(_STEPS):
        numbers = _later(*numbers, wanted, _STEP, *shares)
        if step % 2:
            keys.append((numbers[0], numbers[1], numbers[4]))
    return np.array(keys).T


def _steered_keys(plans: Sequence[Plan], aims: Sequence[Steering]) -> np.ndarray:
    """x, z and yaw of S characters at the keys [S, 3, 13]: what so many steps of `_later` come to."""
    numbers = np.array(plans)
    facings = [_facing(aim) for aim in aims]
    turned = _turned(numbers[:, 4:], np.array([math.nan if yaw is None else yaw for yaw in facings]))
    steady, fading = _DRIFT
    velocity = np.array([(aim.vx, aim.vz) for aim in aims])[..., None]
    places = numbers[:, :2, None] + steady * velocity + fading * (numbers[:, 2:4, None] - velocity)
    return np.concatenate([places, turned[:, None]], 1)


def _drift() -> tuple[np.ndarray, np.ndarray]:
    """Seconds for which a wanted velocity has counted at each key [13], and for which one has that fades into it."""
    kept = 1 - _shares(_STEP)[0]
    moved = np.concatenate([[0.0], np.cumsum(kept ** np.arange(1, _STEPS + 1))])
    return _STEP * np.arange(0, _STEPS + 1, 2), _STEP * moved[::2]


_DRIFT = _drift()


def _turned(numbers: np.ndarray, facing: np.ndarray) -> np.ndarray:
    """Yaw at the keys [S, 13] from yaw and rate [S, 2] and the wanted yaw [S], NaN where none is wanted."""
    yaw, rate = numbers[:, 0].copy(), numbers[:, 1] * _STEP  # rates are per step here
    most, gain, turning = _TURN * _STEP, _TURN_GAIN * _STEP, _shares(_STEP)[1]
    free = np.isnan(facing)
    keys = np.empty((len(yaw), KEYS))
    keys[:, 0] = yaw
    for step in range(_STEPS):
        apart = (facing - yaw + math.pi) % _ROUND - math.pi
        apart[free] = 0.0
        rate += (np.minimum(np.maximum(gain * apart, -most), most) - rate) * turning
        yaw += rate
        if step % 2:
            keys[:, step // 2 + 1] = yaw
    return keys


def _facing(aim: Steering) -> float | None:
    """The wanted yaw: where none is asked for, along the velocity, or as it is (None) when standing."""
    if aim.yaw is None and math.hypot(aim.vx, aim.vz) > 0.05:
        return math.atan2(aim.vx, aim.vz)
    return aim.yaw


def _steered(aim: Steering) -> Wanted:
    """The wanted velocity, wherever it is."""
    vx, vz, facing = aim.vx, aim.vz, _facing(aim)
    return lambda x, z, yaw: (vx, vz, yaw if facing is None else facing)


def _guided(aim: Target) -> Wanted:
    """Along the way; from near its end with the final facing."""
    legs = [_leg(start, end) for start, end in pairwise(aim.way)]

    def wanted(x: float, z: float, yaw: float) -> tuple[float, float, float]:
        to_x, to_z, left = _pursue(x, z, legs, aim.way[-1])
        heading = math.atan2(to_x - x, to_z - z)
        speed = min(aim.speed, math.sqrt(2 * _BRAKE * max(left - 0.02, 0.0)), 2.0 * left)
        if left < _NEAR:
            return speed * math.sin(heading), speed * math.cos(heading), aim.yaw
        # Someone who faces away turns before walking off.
        speed *= max(0.08, math.cos(min(abs(wrap(heading - yaw)), math.pi / 2)))
        return speed * math.sin(heading), speed * math.cos(heading), heading

    return wanted


def _leg(start: Place, end: Place) -> Leg:
    """A straight piece of a way."""
    dx, dz = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dx, dz)
    return *start, dx / max(length, 1e-9), dz / max(length, 1e-9), length


def _pursue(x: float, z: float, legs: Sequence[Leg], end: Place) -> tuple[float, float, float]:
    """The place a little ahead of (x, z) on a way to `end`, and how much of the way is left [m]."""
    nearest, behind, travelled = math.inf, 0.0, 0.0  # how far off the way, where on it, and its length so far
    for from_x, from_z, dx, dz, length in legs:
        aside_x, aside_z = x - from_x, z - from_z
        along = aside_x * dx + aside_z * dz
        along = 0.0 if along < 0.0 else length if along > length else along
        off = math.hypot(aside_x - along * dx, aside_z - along * dz)
        if off < nearest:
            nearest, behind = off, travelled + along
        travelled += length
    left = max(travelled - behind, math.hypot(end[0] - x, end[1] - z))
    return *_place_at(legs, behind + _AHEAD, end), left


def _place_at(legs: Sequence[Leg], distance: float, end: Place) -> Place:
    """The place a distance [m] down a way, at most its end."""
    for from_x, from_z, dx, dz, length in legs:
        if distance < length:
            return from_x + distance * dx, from_z + distance * dz
        distance -= length
    return end


def follow(plan: Plan, aim: Aim, x: float, z: float, yaw: float, seconds: float) -> Plan:
    """The plan one frame on, kept near where the character really is."""
    to_x, to_z, vx, vz, to_yaw, rate = advance_plan(plan, aim, seconds)
    pull = 0.06
    apart = math.hypot(x - to_x, z - to_z)
    if apart > 0.3:
        pull = max(pull, 1 - 0.3 / apart)
    turned = wrap(yaw - to_yaw)
    turn_pull = max(0.04, 1 - 0.7 / abs(turned)) if abs(turned) > 0.7 else 0.04
    return Plan(to_x + pull * (x - to_x), to_z + pull * (z - to_z), vx, vz, wrap(to_yaw + turn_pull * turned), rate)
