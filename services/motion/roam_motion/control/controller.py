"""From intents to the motion model's goals: walk up, turn, take a goal pose, hold it, stand up, go on.

Three modes. FREE follows a planned path. INTERACT gives the goal pose to the model and lets bidirectional blending
bring the body to it. RISE asks for a standing place in front of the seat until the figure is up. Where an action has a
planned way (`Transition`), the goal pose moves along it from the entry pose, both ways, and alone decides. What differs
between actions is in actions/.

Lengths are for legs of 0.82 m (see proportions.py); numbers without a source were tuned by hand on the approaches of
`roam evaluate motion`.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from roam_motion.actions import ACTIONS, IDLE, STYLES, WALK
from roam_motion.animation.collision import near
from roam_motion.animation.figure import Figure
from roam_motion.animation.manner import NAMES
from roam_motion.animation.prediction import goal_shapes
from roam_motion.animation.proportions import size
from roam_motion.animation.rows import row_width, split_array
from roam_motion.animation.state import FRAME_RATE
from roam_motion.animation.stepping import BEHIND
from roam_motion.control.actions import footing, outlines_of, seat_of, transition
from roam_motion.control.intent import Goal, Idle, Intent, Steer
from roam_motion.control.keeping_out import kept_out
from roam_motion.control.pace import followed
from roam_motion.control.paths import way
from roam_motion.control.planner import SPEED, Aim, Plan, Steering, Target, follow, plan_keys, wrap
from roam_motion.control.seat import Seat, Transition

FREE, INTERACT, RISE = 0, 1, 2
_ARRIVED = 0.14, math.radians(28)  # distance and heading from which the interaction may begin
_CLOSE = 0.35, math.radians(60)  # good enough when no progress is made
_PATIENCE = 45  # frames
_PACE = 0.06  # [m/s] of a deviate: people cross a room at 1.15 to 1.35
_POISE = 5, 4  # frames before a seat until one sits down, and of a deviate: captured people do after 0 to 0.4 s
_BALANCED = 0.13  # [m] between hips and where they are when one stands well, seen from above
_UPRIGHT = 0.86  # [m] hips higher than this: standing
_LATE = 75  # frames after which sitting down should be over; then the goal pose draws ever more
_URGENT = 60  # frames until it alone decides
_ENTERED = 0.05, 15  # [m] from the entry pose's hips, and frames, after which one goes on along the planned way
_HANDOVER = 15, 30  # frames until the planned way alone decides, and until it lets go of the body at its end
_REVERSAL = 0.1  # change of pace per frame when someone on the planned way shall turn round
_PAUSE = 6  # frames in the entry pose before getting up from it
_RISE_LIMIT = 12 * FRAME_RATE  # frames after which rising is given up for standing


class Control(NamedTuple):
    """The controller's own memory of one character."""

    plan: Plan
    mode: int = FREE
    seat: Seat | None = None
    since: int = 0  # frames in this mode
    waiting: int = 0  # frames close to the standing place without arriving
    clock: float = 0.0  # [s] of the living idle; starts where the seed says
    along: float = 0.0  # frames of the planned way behind it, 0 in the entry pose, beyond its `last` on the way back
    pace: float = 0.0  # frames of that way per frame, negative for who turns round on it


class Body(NamedTuple):
    """What the controller looks at: root x, z, yaw, hip height, and the middle of the ankles on the floor [m]."""

    x: float
    z: float
    yaw: float
    height: float
    feet: tuple[float, float] | None = None  # None: under the root
    manner: tuple[float, ...] = (0.0,) * len(NAMES)  # see manner.py

    def deviate(self, name: str) -> float:
        """One number of the manner."""
        return self.manner[NAMES.index(name)]


class GoalRows:
    """The motion model's goals of B characters, a row of `Goals` for each; written in place, one by one."""

    def __init__(self, figure: Figure, count: int) -> None:
        shapes = goal_shapes(figure.joint_count)
        self.rows = np.zeros((count, row_width(shapes)), np.float32)  # [B, G]
        self.fields = split_array(self.rows, shapes)
        self.fields["pose_orientations"][:] = np.eye(3)

    def go(self, row: int, places: np.ndarray, directions: np.ndarray, style: str, feet: np.ndarray | None) -> None:
        """Along `places` and `directions` [13, 2], or [2] to stay."""
        fields = self.fields
        fields["positions"][row], fields["directions"][row] = places, directions
        fields["action"][row, STYLES.index(style)] = 1
        if feet is not None:
            fields["feet"][row] = feet

    def take(self, row: int, seat: Seat, style: str, urgency: float, feet: np.ndarray | None) -> None:
        """A goal pose."""
        self.go(row, seat.root[:2], seat.root[2:], style, feet)
        fields = self.fields
        fields["active"][row], fields["urgency"][row] = 1, urgency
        fields["pose_positions"][row], fields["pose_orientations"][row] = seat.positions, seat.orientations


def control(
    figure: Figure, states: Sequence[Control], intents: Sequence[Intent], bodies: Sequence[Body]
) -> tuple[list[Control], GoalRows]:
    """The controller's next memory of every character, and the motion model's goals."""
    after = [_decided(figure, *character) for character in zip(states, intents, bodies, strict=True)]
    goals, free = GoalRows(figure, len(after)), []
    for row, state in enumerate(after):
        if state.mode != FREE and state.seat is not None:
            _seated(figure, state, transition(figure, state.seat, bodies[row].manner), goals, row)
        else:
            free.append(row)
    aims = [_aim(figure, after[row], intents[row], bodies[row]) for row in free]
    for row, aim in zip(free, aims, strict=True):
        x, z = _anchor(figure, aim, bodies[row])
        plan = follow(after[row].plan, aim, x, z, bodies[row].yaw, 1 / FRAME_RATE)
        after[row] = after[row]._replace(plan=plan)
    _walk(figure, [(row, after[row], bodies[row]) for row in free], aims, goals)
    return after, goals


def _decided(figure: Figure, state: Control, intent: Intent, body: Body) -> Control:
    """The memory with the mode of this frame."""
    state = state._replace(since=state.since + 1, clock=state.clock + 1 / FRAME_RATE)
    if state.mode == INTERACT and _leaves(figure, state, intent, body):
        state = state._replace(mode=RISE, since=0)
    if state.mode != FREE and state.seat is not None and (planned := transition(figure, state.seat, body.manner)):
        state = _moved_along(planned, state, body)
    if state.mode == RISE and state.along == 0 and (_stands(figure, state, body) or state.since > _RISE_LIMIT):
        state = Control(Plan(body.x, body.z, yaw=body.yaw), seat=state.seat, clock=state.clock)
    return _approach(figure, state, intent, body) if state.mode == FREE else state


def _walk(
    figure: Figure, characters: Sequence[tuple[int, Control, Body]], aims: Sequence[Aim], goals: GoalRows
) -> None:
    """Asks those who walk or stand to go where their plans do; `characters` with their rows."""
    places, directions = plan_keys([state.plan for _, state, _ in characters], aims)
    gone = np.hypot(*(places[:, 4] - places[:, 0]).T).tolist()
    alike = (directions[:, 4] * directions[:, 0]).sum(1).tolist()
    for index, ((row, state, body), aim) in enumerate(zip(characters, aims, strict=True)):
        plan = state.plan
        x, z = _over_feet(figure, body)
        still = gone[index] < 0.1 and alike[index] > 0.95
        # Off balance, or still under way: take a step.
        still = still and math.hypot(plan.vx, plan.vz) < 0.15
        still = still and math.hypot(x - body.x, z - body.z) < _BALANCED
        seat = state.seat if isinstance(aim, Target) else None
        feet = footing(figure, seat) if seat is not None and _before(seat, body, *_CLOSE) else None
        goals.go(row, places[index], directions[index], (IDLE if still else WALK).style, feet)


def _seated(figure: Figure, state: Control, planned: Transition | None, goals: GoalRows, row: int) -> None:
    """Asks someone who takes a goal pose, holds it or leaves it for what comes next."""
    seat = state.seat
    assert seat is not None
    style = ACTIONS[seat.action].style
    if state.mode == RISE and state.along == 0 and not (planned and state.since < _PAUSE):
        goals.go(row, seat.stand[:2], seat.stand[2:], IDLE.style, None)
        return
    urgency = (state.since - _LATE) / _URGENT
    if planned is not None:
        seat = planned.at(round(state.along))
        if not planned.lies(state.along):
            style = ACTIONS[planned.entry.action].style
        if state.along == planned.last:
            urgency = 1 - state.since / _HANDOVER[1]
        elif state.along > 0:
            urgency = max(min(state.along, planned.end - state.along) / _HANDOVER[0], urgency)
    feet = footing(figure, seat) if state.along == 0 else None
    goals.take(row, seat, style, min(max(urgency, 0.0), 1.0), feet)


def _moved_along(planned: Transition, state: Control, body: Body) -> Control:
    """One frame on: from the entry pose to the goal pose, and from there to the entry pose again when rising; who is
    under way and shall do the other turns round."""
    forth, last, end = state.mode == INTERACT, float(planned.last), float(planned.end)
    if state.along == 0 and not (forth and _entered(planned.entry, state, body)):
        return state
    back = state.along > last or (state.along == last and not forth)
    low, high = (last, end) if back else (0.0, last)
    pace = target = 1.0 if forth != back else -1.0
    if low < state.along < high:
        pace = min(max(target, state.pace - _REVERSAL), state.pace + _REVERSAL)
    along = min(max(state.along + pace, low), high)
    along = 0.0 if along == end else along
    arrived = along in (0.0, last) and along != state.along
    return state._replace(along=along, pace=pace, since=0 if arrived else state.since)


def _entered(entry: Seat, state: Control, body: Body) -> bool:
    """Whether someone has taken the entry pose well enough to go on, or should long have done so."""
    apart = math.dist((body.x, body.height, body.z), entry.positions[0].tolist())
    return (apart < _ENTERED[0] and state.since > _ENTERED[1]) or state.since > _LATE + _URGENT


def _anchor(figure: Figure, aim: Aim, body: Body) -> tuple[float, float]:
    """Where the plan belongs: at the root, but when standing still over the feet, or they lean on each other."""
    stands = isinstance(aim, Steering) and math.hypot(aim.vx, aim.vz) < 0.05
    return _over_feet(figure, body) if stands else (body.x, body.z)


def _over_feet(figure: Figure, body: Body) -> tuple[float, float]:
    """Where the root of a body is that stands well on its feet: a little before its ankles."""
    if body.feet is None:
        return body.x, body.z
    behind = BEHIND * size(figure)
    return body.feet[0] + behind * math.sin(body.yaw), body.feet[1] + behind * math.cos(body.yaw)


def _leaves(figure: Figure, state: Control, intent: Intent, body: Body) -> bool:
    if not isinstance(intent, Goal) or state.seat is None:
        return True
    return not seat_of(figure, intent, (body.x, body.z)).same_as(state.seat)


def _stands(figure: Figure, state: Control, body: Body) -> bool:
    if state.seat is None:
        return True
    apart = math.hypot(body.x - state.seat.stand[0], body.z - state.seat.stand[1])
    return body.height > _UPRIGHT * size(figure) and (apart < 0.2 or state.since > 2 * FRAME_RATE)


def _approach(figure: Figure, state: Control, intent: Intent, body: Body) -> Control:
    """Keeps the seat of the goal in mind, and begins the interaction on arrival.

    The seat that somebody has left stays in mind as long as limbs can touch it.
    """
    if not isinstance(intent, Goal):
        touches = (
            state.seat is not None and state.seat.volume is not None and near(figure, state.seat.volume, body.x, body.z)
        )
        return state if touches else state._replace(seat=None, waiting=0)
    seat = state.seat
    if seat is None or state.since % FRAME_RATE == 0 or not seat_of(figure, intent, (body.x, body.z)).same_as(seat):
        seat = seat_of(figure, intent, (body.x, body.z))
    waiting = state.waiting + 1 if _before(seat, body, *_CLOSE) else 0
    pause = _POISE[0] + _POISE[1] * body.deviate("poise")
    if (_before(seat, body, *_ARRIVED) and waiting > pause) or waiting > _PATIENCE:
        return state._replace(mode=INTERACT, seat=seat, since=0, waiting=0)
    return state._replace(seat=seat, waiting=waiting)


def _before(seat: Seat, body: Body, near: float, turned: float) -> bool:
    """Whether someone stands before a seat, `near` [m] the place for it and so far turned [rad] at most."""
    x, z, dx, dz = seat.stand
    return math.hypot(body.x - x, body.z - z) < near and abs(wrap(body.yaw - math.atan2(dx, dz))) < turned


def _aim(figure: Figure, state: Control, intent: Intent, body: Body) -> Aim:
    if isinstance(intent, Goal) and state.seat is not None:
        x, z, dx, dz = map(float, state.seat.stand)
        outlines = outlines_of(figure, intent)
        corners = way((state.plan.x, state.plan.z), (x, z), (dx, dz), outlines)
        return Target(x, z, math.atan2(dx, dz), corners, SPEED + _PACE * body.deviate("pace"))
    if isinstance(intent, Steer):
        turn = None if intent.facing is None else math.atan2(*map(float, intent.facing))
        velocity = kept_out(figure, intent.around, (body.x, body.z), followed(intent))
        return Steering(*velocity, turn)
    assert isinstance(intent, Idle | Goal)
    return Steering(0.0, 0.0, None)
