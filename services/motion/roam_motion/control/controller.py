"""From intents to the network's goals: walk up, turn, sit or lie, hold, stand up, go on.

Three modes. FREE follows a planned path. INTERACT gives the goal pose to the network and lets bidirectional blending
bring the body to it. RISE asks for a standing place in front of the seat until the figure is up. Between the edge of
the furniture and a lying pose, both ways, the goal pose moves along a planned way (see reclining.py) and alone decides.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from roam_motion.animation.figure import Figure
from roam_motion.animation.prediction import goal_shapes
from roam_motion.animation.rows import row_width, split_array
from roam_motion.animation.state import ACTIONS, FRAME_RATE, KEYS
from roam_motion.animation.stepping import BEHIND
from roam_motion.control.intent import Goal, Idle, Intent, Steer
from roam_motion.control.paths import way
from roam_motion.control.planner import Aim, Plan, Steering, Target, follow, plan_keys, wrap
from roam_motion.control.reclining import Reclining, reclining_of
from roam_motion.control.seat import Seat, footing, outlines_of, seat_of

FREE, INTERACT, RISE = 0, 1, 2
_ARRIVED = 0.14, math.radians(28)  # distance and heading from which the interaction may begin
_CLOSE = 0.35, math.radians(60)  # good enough when no progress is made
_PATIENCE = 45  # frames
_BALANCED = 0.13  # [m] between hips and where they are when one stands well, seen from above
_UPRIGHT = 0.86  # [m] hips higher than this: standing
_LATE = 75  # frames after which sitting down should be over; then the goal pose draws ever more
_URGENT = 60  # frames until it alone decides
_SAT = 0.05, 15  # [m] from the hips on the edge, and frames after which one goes on to lie down
_HANDOVER = 15, 30  # frames until the planned way alone decides, and until it lets go of the lying body
_REVERSAL = 0.1  # change of pace per frame when someone who is lying down shall get up, or the other way round
_LIES = 0.4  # share of the planned way from which one lies
_PAUSE = 6  # frames on the edge before getting up from it
_RISE_LIMIT = 12 * FRAME_RATE  # frames after which rising is given up for standing


class Control(NamedTuple):
    """The controller's own memory of one character."""

    plan: Plan
    mode: int = FREE
    seat: Seat | None = None
    since: int = 0  # frames in this mode
    waiting: int = 0  # frames close to the standing place without arriving
    clock: float = 0.0  # [s] of the living idle; starts where the seed says
    along: float = 0.0  # frames of the way from the edge to the lying pose, 0 on the edge
    pace: float = 0.0  # frames of that way per frame, negative when getting up


class Body(NamedTuple):
    """What the controller looks at: root x, z, yaw, hip height, and the middle of the ankles on the floor [m]."""

    x: float
    z: float
    yaw: float
    height: float
    feet: tuple[float, float] | None = None  # None: under the root


class Command(NamedTuple):
    """Network goals of one character for one frame."""

    places: np.ndarray  # [13, 2]
    directions: np.ndarray  # [13, 2]
    action: int
    active: bool
    seat: Seat | None = None
    urgency: float = 0.0
    feet: np.ndarray | None = None  # [2, 4] where feet belong (see `Goals`)


def control(
    figure: Figure, states: Sequence[Control], intents: Sequence[Intent], bodies: Sequence[Body]
) -> tuple[list[Control], list[Command]]:
    """The controller's next memory of every character, and the network's goals."""
    after = [_decided(figure, *character) for character in zip(states, intents, bodies, strict=True)]
    commands = {row: _seated(figure, s, s.seat) for row, s in enumerate(after) if s.mode != FREE and s.seat is not None}
    free = [row for row in range(len(after)) if row not in commands]
    aims = [_aim(figure, after[row], intents[row]) for row in free]
    for row, aim in zip(free, aims, strict=True):
        x, z = _anchor(aim, bodies[row])
        plan = follow(after[row].plan, aim, x, z, bodies[row].yaw, 1 / FRAME_RATE)
        after[row] = after[row]._replace(plan=plan)
    walks = _walks(figure, [after[row] for row in free], aims, [bodies[row] for row in free])
    commands.update(zip(free, walks, strict=True))
    return after, [commands[row] for row in range(len(after))]


def _decided(figure: Figure, state: Control, intent: Intent, body: Body) -> Control:
    """The memory with the mode of this frame."""
    state = state._replace(since=state.since + 1, clock=state.clock + 1 / FRAME_RATE)
    if state.mode == INTERACT and _leaves(figure, state, intent, body):
        state = state._replace(mode=RISE, since=0)
    if state.mode != FREE and state.seat is not None and state.seat.lying:
        state = _reclined(reclining_of(figure, state.seat), state, body)
    if state.mode == RISE and state.along == 0 and (_stands(state, body) or state.since > _RISE_LIMIT):
        state = Control(Plan(body.x, body.z, yaw=body.yaw), clock=state.clock)
    return _approach(figure, state, intent, body) if state.mode == FREE else state


def _walks(figure: Figure, states: Sequence[Control], aims: Sequence[Aim], bodies: Sequence[Body]) -> list[Command]:
    """What is asked of those who walk or stand: to go where their plans do."""
    places, directions = plan_keys([state.plan for state in states], aims)
    gone = np.hypot(*(places[:, 4] - places[:, 0]).T).tolist()
    alike = (directions[:, 4] * directions[:, 0]).sum(1).tolist()
    idle, walk = ACTIONS.index("idle"), ACTIONS.index("walk")
    commands = []
    for row, (state, body) in enumerate(zip(states, bodies, strict=True)):
        plan = state.plan
        x, z = _over_feet(body)
        still = gone[row] < 0.1 and alike[row] > 0.95
        # Off balance, or still under way: take a step.
        still = still and math.hypot(plan.vx, plan.vz) < 0.15
        still = still and math.hypot(x - body.x, z - body.z) < _BALANCED
        near = state.seat if state.seat is not None and _before(state.seat, body, *_CLOSE) else None
        feet = None if near is None else footing(figure, near)
        commands.append(Command(places[row], directions[row], idle if still else walk, False, feet=feet))
    return commands


def _seated(figure: Figure, state: Control, seat: Seat) -> Command:
    """What is asked of someone who takes a seat, holds it or leaves it."""
    if state.mode == RISE and state.along == 0 and not (seat.lying and state.since < _PAUSE):
        return _hold(seat.stand, ACTIONS.index("idle"), None)
    urgency = (state.since - _LATE) / _URGENT
    lies = False
    if seat.lying:
        way = reclining_of(figure, seat)
        seat, lies = way.at(round(state.along)), state.along > _LIES * way.last
        if state.along >= way.last:
            urgency = 1 - state.since / _HANDOVER[1]
        elif state.along > 0:
            urgency = max(state.along / _HANDOVER[0], urgency)
    command = _hold(seat.root, ACTIONS.index("lie" if lies else "sit"), seat)
    feet = footing(figure, seat) if state.along == 0 else None
    return command._replace(urgency=min(max(urgency, 0.0), 1.0), feet=feet)


def _reclined(way: Reclining, state: Control, body: Body) -> Control:
    """One frame on between the edge and the lying pose: down when interacting, up when rising."""
    down, end = state.mode == INTERACT, float(way.last)
    if state.along == 0 and not (down and _sat(way.edge, state, body)):
        return state
    target = 1.0 if down else -1.0
    pace = target
    if 0 < state.along < end:
        pace = min(max(target, state.pace - _REVERSAL), state.pace + _REVERSAL)
    along = min(max(state.along + pace, 0.0), end)
    arrived = along in (0.0, end) and along != state.along
    return state._replace(along=along, pace=pace, since=0 if arrived else state.since)


def _sat(edge: Seat, state: Control, body: Body) -> bool:
    """Whether someone sits on the edge well enough to go on, or should long do so."""
    apart = math.dist((body.x, body.height, body.z), edge.positions[0].tolist())
    return (apart < _SAT[0] and state.since > _SAT[1]) or state.since > _LATE + _URGENT


def _anchor(aim: Aim, body: Body) -> tuple[float, float]:
    """Where the plan belongs: at the root, but when standing still over the feet, or they lean on each other."""
    stands = isinstance(aim, Steering) and math.hypot(aim.vx, aim.vz) < 0.05
    return _over_feet(body) if stands else (body.x, body.z)


def _over_feet(body: Body) -> tuple[float, float]:
    """Where the root of a body is that stands well on its feet: a little before its ankles."""
    if body.feet is None:
        return body.x, body.z
    return body.feet[0] + BEHIND * math.sin(body.yaw), body.feet[1] + BEHIND * math.cos(body.yaw)


def _leaves(figure: Figure, state: Control, intent: Intent, body: Body) -> bool:
    if not isinstance(intent, Goal) or state.seat is None:
        return True
    return not seat_of(figure, intent, (body.x, body.z)).same_as(state.seat)


def _stands(state: Control, body: Body) -> bool:
    if state.seat is None:
        return True
    apart = math.hypot(body.x - state.seat.stand[0], body.z - state.seat.stand[1])
    return body.height > _UPRIGHT and (apart < 0.2 or state.since > 2 * FRAME_RATE)


def _approach(figure: Figure, state: Control, intent: Intent, body: Body) -> Control:
    """Keeps the seat of the goal in mind, and begins the interaction on arrival."""
    if not isinstance(intent, Goal):
        return state if state.seat is None and not state.waiting else state._replace(seat=None, waiting=0)
    seat = state.seat
    if seat is None or state.since % FRAME_RATE == 0 or not seat_of(figure, intent, (body.x, body.z)).same_as(seat):
        seat = seat_of(figure, intent, (body.x, body.z))
    waiting = state.waiting + 1 if _before(seat, body, *_CLOSE) else 0
    if _before(seat, body, *_ARRIVED) or waiting > _PATIENCE:
        return state._replace(mode=INTERACT, seat=seat, since=0, waiting=0)
    return state._replace(seat=seat, waiting=waiting)


def _before(seat: Seat, body: Body, near: float, turned: float) -> bool:
    """Whether someone stands before a seat, `near` [m] the place for it and so far turned [rad] at most."""
    x, z, dx, dz = seat.stand
    return math.hypot(body.x - x, body.z - z) < near and abs(wrap(body.yaw - math.atan2(dx, dz))) < turned


def _aim(figure: Figure, state: Control, intent: Intent) -> Aim:
    if isinstance(intent, Goal) and state.seat is not None:
        x, z, dx, dz = map(float, state.seat.stand)
        outlines = outlines_of(figure, intent)
        return Target(x, z, math.atan2(dx, dz), way((state.plan.x, state.plan.z), (x, z), (dx, dz), outlines))
    if isinstance(intent, Steer):
        velocity = np.asarray(intent.velocity, float)
        turn = None if intent.facing is None else math.atan2(*map(float, intent.facing))
        return Steering(float(velocity[0]), float(velocity[1]), turn)
    assert isinstance(intent, Idle | Goal)
    return Steering(0.0, 0.0, None)


def _hold(root: np.ndarray, action: int, seat: Seat | None) -> Command:
    places = np.broadcast_to(root[:2], (KEYS, 2)).astype(np.float32)
    directions = np.broadcast_to(root[2:], (KEYS, 2)).astype(np.float32)
    return Command(places, directions, action, seat is not None, seat)


def goals_of(figure: Figure, commands: list[Command]) -> np.ndarray:
    """The network's goals, a row of `Goals` for every character [B, G]."""
    shapes = goal_shapes(figure.joint_count)
    rows = np.zeros((len(commands), row_width(shapes)), np.float32)
    goals = split_array(rows, shapes)
    goals["pose_orientations"][:] = np.eye(3)
    for i, command in enumerate(commands):
        goals["positions"][i], goals["directions"][i] = command.places, command.directions
        goals["action"][i, command.action] = 1
        goals["active"][i], goals["urgency"][i] = command.active, command.urgency
        if command.feet is not None:
            goals["feet"][i] = command.feet
        if command.seat is not None:
            goals["pose_positions"][i] = command.seat.positions
            goals["pose_orientations"][i] = command.seat.orientations
    return rows
