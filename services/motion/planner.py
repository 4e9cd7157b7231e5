"""The planned root path of the next two seconds: the goals that the network follows in locomotion.

A simulated root with smooth velocity and turning walks ahead of the character: along a way to a target, or at a wanted
velocity. Plain Python numbers in one loop: two dozen small steps one after another are quicker that way than as arrays,
whatever the number of characters, and quicker than with an object for every step.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np

from motion.state import KEYS
from motion.ways import Place

_STEP = 1 / 12  # [s] of the simulation; a key is two steps
_SPEED = 0.9  # [m/s] walking: at 1.0 a swinging foot passes 12 cm a frame
_BRAKE = 0.9  # [m/s2]
_AGILITY = 0.25, 0.15  # [s] time constants of velocity and turn rate
_TURN = 2.2  # [rad/s] fastest turn
_TURN_GAIN = 3.5  # [1/s]
_NEAR = 0.55  # [m] from the target the figure turns to its final facing
_AHEAD = 0.3  # [m] along its way that the figure looks: corners are cut by a hand's breadth
_ROUND = 2 * math.pi

Wanted = Callable[[float, float, float], tuple[float, float, float]]  # x, z, yaw -> wanted velocity and yaw
Leg = tuple[float, float, float, float, float]  # of a way: start, direction, length


@dataclass(frozen=True)
class Plan:
    """A simulated root: place, velocity, yaw, yaw rate."""

    x: float
    z: float
    vx: float = 0.0
    vz: float = 0.0
    yaw: float = 0.0
    rate: float = 0.0


@dataclass(frozen=True)
class Target:
    """Where to stand: place, yaw; and the corners of the way there, both ends included (see ways.py)."""

    x: float
    z: float
    yaw: float
    way: tuple[Place, ...]


@dataclass(frozen=True)
class Steering:
    """A wanted velocity and yaw (None: along the velocity, or as it is when standing)."""

    vx: float
    vz: float
    yaw: float | None


def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % _ROUND - math.pi


def advance_plan(plan: Plan, aim: Target | Steering, seconds: float) -> Plan:
    """The plan a little later."""
    return Plan(*next(_simulated(plan, aim, seconds)))


def plan_keys(plan: Plan, aim: Target | Steering) -> tuple[np.ndarray, np.ndarray]:
    """Planned places [13, 2] and directions [13, 2] at 0, 1/6, … 2 s."""
    later = islice(_simulated(plan, aim, _STEP), 1, 2 * (KEYS - 1), 2)
    keys = np.array([(plan.x, plan.z, plan.yaw), *((x, z, yaw) for x, z, _, _, yaw, _ in later)], np.float32)
    directions = np.empty((KEYS, 2), np.float32)
    np.sin(keys[:, 2], out=directions[:, 0])
    np.cos(keys[:, 2], out=directions[:, 1])
    return keys[:, :2], directions


def _simulated(plan: Plan, aim: Target | Steering, seconds: float) -> Iterator[tuple[float, ...]]:
    """The numbers of the plan after every step of so many `seconds`, for ever."""
    x, z, vx, vz, yaw, rate = plan.x, plan.z, plan.vx, plan.vz, plan.yaw, plan.rate
    soft, turning = (1 - math.exp(-seconds / constant) for constant in _AGILITY)
    wanted = _steered(aim) if isinstance(aim, Steering) else _guided(aim)
    while True:
        to_vx, to_vz, to_yaw = wanted(x, z, yaw)
        to_rate = _TURN_GAIN * ((to_yaw - yaw + math.pi) % _ROUND - math.pi)
        to_rate = _TURN if to_rate > _TURN else -_TURN if to_rate < -_TURN else to_rate
        vx += (to_vx - vx) * soft
        vz += (to_vz - vz) * soft
        rate += (to_rate - rate) * turning
        x += vx * seconds
        z += vz * seconds
        yaw = (yaw + rate * seconds + math.pi) % _ROUND - math.pi
        yield x, z, vx, vz, yaw, rate


def _steered(aim: Steering) -> Wanted:
    """The wanted velocity, wherever it is; where no yaw is wanted, along it, or as it is when standing."""
    vx, vz, facing = aim.vx, aim.vz, aim.yaw
    if facing is None and math.hypot(vx, vz) > 0.05:
        facing = math.atan2(vx, vz)
    return lambda x, z, yaw: (vx, vz, yaw if facing is None else facing)


def _guided(aim: Target) -> Wanted:
    """Along the way; from near its end with the final facing."""
    legs = [_leg(start, end) for start, end in pairwise(aim.way)]

    def wanted(x: float, z: float, yaw: float) -> tuple[float, float, float]:
        to_x, to_z, left = _pursue(x, z, legs, aim.way[-1])
        heading = math.atan2(to_x - x, to_z - z)
        speed = min(_SPEED, math.sqrt(2 * _BRAKE * max(left - 0.02, 0.0)), 2.0 * left)
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


def follow(plan: Plan, aim: Target | Steering, x: float, z: float, yaw: float, seconds: float) -> Plan:
    """The plan one frame on, kept near where the character really is."""
    to_x, to_z, vx, vz, to_yaw, rate = next(_simulated(plan, aim, seconds))
    pull = 0.06
    apart = math.hypot(x - to_x, z - to_z)
    if apart > 0.3:
        pull = max(pull, 1 - 0.3 / apart)
    turned = wrap(yaw - to_yaw)
    turn_pull = max(0.04, 1 - 0.7 / abs(turned)) if abs(turned) > 0.7 else 0.04
    return Plan(to_x + pull * (x - to_x), to_z + pull * (z - to_z), vx, vz, wrap(to_yaw + turn_pull * turned), rate)
