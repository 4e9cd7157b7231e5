"""The planned root path of the next two seconds: the goals that the network follows in locomotion.

A simulated root with smooth velocity and turning walks ahead of the character: along a way to a target, or at a wanted
velocity. Plain Python numbers: two dozen small steps are quicker that way than as arrays.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

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
    return (angle + math.pi) % (2 * math.pi) - math.pi


def advance_plan(plan: Plan, aim: Target | Steering, seconds: float) -> Plan:
    """The plan a little later."""
    vx, vz, yaw = _wanted(plan, aim)
    error = wrap(yaw - plan.yaw)
    rate = max(-_TURN, min(_TURN, _TURN_GAIN * error))
    soft = 1 - math.exp(-seconds / _AGILITY[0]), 1 - math.exp(-seconds / _AGILITY[1])
    vx, vz = plan.vx + (vx - plan.vx) * soft[0], plan.vz + (vz - plan.vz) * soft[0]
    rate = plan.rate + (rate - plan.rate) * soft[1]
    return Plan(plan.x + vx * seconds, plan.z + vz * seconds, vx, vz, wrap(plan.yaw + rate * seconds), rate)


def _wanted(plan: Plan, aim: Target | Steering) -> tuple[float, float, float]:
    """Wanted velocity and yaw at a plan's place."""
    if isinstance(aim, Steering):
        moving = math.hypot(aim.vx, aim.vz) > 0.05
        along = math.atan2(aim.vx, aim.vz) if moving else plan.yaw
        return aim.vx, aim.vz, along if aim.yaw is None else aim.yaw
    x, z, left = _pursue(plan.x, plan.z, aim.way)
    heading = math.atan2(x - plan.x, z - plan.z)
    speed = min(_SPEED, math.sqrt(2 * _BRAKE * max(left - 0.02, 0.0)), 2.0 * left)
    if left < _NEAR:
        return speed * math.sin(heading), speed * math.cos(heading), aim.yaw
    # Someone who faces away turns before walking off.
    speed *= max(0.08, math.cos(min(abs(wrap(heading - plan.yaw)), math.pi / 2)))
    return speed * math.sin(heading), speed * math.cos(heading), heading


def _pursue(x: float, z: float, way: tuple[Place, ...]) -> tuple[float, float, float]:
    """The place a little ahead of (x, z) on a way, and how much of the way is left [m]."""
    nearest, behind, travelled = math.inf, 0.0, 0.0  # how far off the way, where on it, and its length so far
    for (ax, az), (bx, bz) in pairwise(way):
        length = math.hypot(bx - ax, bz - az)
        along = ((x - ax) * (bx - ax) + (z - az) * (bz - az)) / max(length, 1e-9)
        along = min(max(along, 0.0), length)
        share = along / max(length, 1e-9)
        off = math.hypot(ax + share * (bx - ax) - x, az + share * (bz - az) - z)
        if off < nearest:
            nearest, behind = off, travelled + along
        travelled += length
    left = max(travelled - behind, math.hypot(way[-1][0] - x, way[-1][1] - z))
    return *_place_at(way, behind + _AHEAD), left


def _place_at(way: tuple[Place, ...], distance: float) -> Place:
    """The place a distance [m] down a way, at most its end."""
    for (ax, az), (bx, bz) in pairwise(way):
        length = math.hypot(bx - ax, bz - az)
        if distance < length:
            share = distance / length
            return ax + share * (bx - ax), az + share * (bz - az)
        distance -= length
    return way[-1]


def plan_keys(plan: Plan, aim: Target | Steering) -> tuple[np.ndarray, np.ndarray]:
    """Planned places [13, 2] and directions [13, 2] at 0, 1/6, … 2 s."""
    places, directions = np.empty((KEYS, 2), np.float32), np.empty((KEYS, 2), np.float32)
    for key in range(KEYS):
        places[key] = plan.x, plan.z
        directions[key] = math.sin(plan.yaw), math.cos(plan.yaw)
        plan = advance_plan(advance_plan(plan, aim, _STEP), aim, _STEP)
    return places, directions


def follow(plan: Plan, aim: Target | Steering, x: float, z: float, yaw: float, seconds: float) -> Plan:
    """The plan one frame on, kept near where the character really is."""
    plan = advance_plan(plan, aim, seconds)
    pull = 0.06
    apart = math.hypot(x - plan.x, z - plan.z)
    if apart > 0.3:
        pull = max(pull, 1 - 0.3 / apart)
    turned = wrap(yaw - plan.yaw)
    turn_pull = max(0.04, 1 - 0.7 / abs(turned)) if abs(turned) > 0.7 else 0.04
    return replace(
        plan, x=plan.x + pull * (x - plan.x), z=plan.z + pull * (z - plan.z), yaw=wrap(plan.yaw + turn_pull * turned)
    )
