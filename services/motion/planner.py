"""The planned root path of the next two seconds: the goals that the network follows in locomotion.

A simulated root with smooth velocity and turning walks ahead of the character: straight at a target, round a disc where
furniture stands, or at a wanted velocity. Plain Python numbers: two dozen small steps are quicker that way than as
arrays.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from motion.state import KEYS

_STEP = 1 / 12  # [s] of the simulation; a key is two steps
_SPEED = 0.9  # [m/s] walking: at 1.0 a swinging foot passes 12 cm a frame
_BRAKE = 0.9  # [m/s2]
_AGILITY = 0.25, 0.15  # [s] time constants of velocity and turn rate
_TURN = 2.2  # [rad/s] fastest turn
_TURN_GAIN = 3.5  # [1/s]
_NEAR = 0.55  # [m] from the target the figure turns to its final facing
_AROUND = 0.95  # [m] radius of the way round the seat
_FRONT = math.radians(55)  # approaches from within this cone walk straight in


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
    """Where to stand: place, yaw; `around` is the seat's centre (x, z) and the yaw of its open side, not to be walked
    through."""

    x: float
    z: float
    yaw: float
    around: tuple[float, float, float] | None = None


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
    left = math.hypot(aim.x - plan.x, aim.z - plan.z)
    x, z = _waypoint(plan, aim)
    heading = math.atan2(x - plan.x, z - plan.z)
    speed = min(_SPEED, math.sqrt(2 * _BRAKE * max(left - 0.02, 0.0)), 2.0 * left)
    if left < _NEAR:
        return speed * math.sin(heading), speed * math.cos(heading), aim.yaw
    # Someone who faces away turns before walking off.
    speed *= max(0.08, math.cos(min(abs(wrap(heading - plan.yaw)), math.pi / 2)))
    return speed * math.sin(heading), speed * math.cos(heading), heading


def _waypoint(plan: Plan, aim: Target) -> tuple[float, float]:
    """Next point to walk to: the target, or a point on the circle round the seat towards its open side."""
    if aim.around is None:
        return aim.x, aim.z
    cx, cz, open_yaw = aim.around
    angle = wrap(math.atan2(plan.x - cx, plan.z - cz) - open_yaw)
    if abs(angle) < _FRONT:
        return aim.x, aim.z
    on = open_yaw + math.copysign(max(abs(angle) - math.radians(45), 0.0), angle)
    return cx + _AROUND * math.sin(on), cz + _AROUND * math.cos(on)


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
