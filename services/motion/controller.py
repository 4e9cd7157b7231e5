"""From intents to the network's goals: walk up, turn, sit or lie, hold, stand up, go on.

Three modes. FREE follows a planned path. INTERACT gives the goal pose to the network and lets bidirectional blending
bring the body to it. RISE asks for a standing place in front of the seat until the figure is up. The paper sets the
walking goal 0.3 m in front of the goal feet; in the captured sits people stand *over* their later feet when they begin
(median 0.00 m), so the standing place is 5 cm in front of them.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from character.pose import Pose

from motion.features import Goals
from motion.figure import Figure
from motion.intent import Goal, Idle, Intent, Steer
from motion.planner import Plan, Steering, Target, follow, plan_keys, wrap
from motion.state import ACTIONS, FRAME_RATE, KEYS

FREE, INTERACT, RISE = 0, 1, 2
_STAND_AHEAD = 0.05  # [m] standing place in front of the goal's ankles
_LIE_ASIDE = 0.38  # [m] standing place beside the lying hips
_ARRIVED = 0.14, math.radians(28)  # distance and heading from which the interaction may begin
_CLOSE = 0.35, math.radians(60)  # good enough when no progress is made
_PATIENCE = 45  # frames
_BALANCED = 0.13  # [m] between hips and the middle of the feet, seen from above
_UPRIGHT = 0.86  # [m] hips higher than this: standing
_LATE = 75, 240  # frames after which sitting down, lying down should be over; then the goal pose draws ever more
_URGENT = 60  # frames until it alone decides
_RISE_LIMIT = 12 * FRAME_RATE  # frames after which rising is given up for standing


@dataclass(frozen=True)
class Seat:
    """A goal pose as the controller needs it."""

    positions: np.ndarray  # [J, 3]
    orientations: np.ndarray  # [J, 3, 3]
    root: np.ndarray  # [4] x, z, direction
    stand: np.ndarray  # [4] where to stand before and after: x, z, direction
    lying: bool

    def same_as(self, other: "Seat") -> bool:
        """Whether the pose is the same to a tenth of a millimetre."""
        return self.lying == other.lying and bool(np.abs(self.positions - other.positions).max() < 1e-4)


@dataclass(frozen=True)
class Control:
    """The controller's own memory of one character."""

    plan: Plan
    mode: int = FREE
    seat: Seat | None = None
    since: int = 0  # frames in this mode
    waiting: int = 0  # frames close to the standing place without arriving


@dataclass(frozen=True)
class Body:
    """What the controller looks at: root x, z, yaw, hip height, and the middle of the ankles on the floor [m]."""

    x: float
    z: float
    yaw: float
    height: float
    feet: tuple[float, float] | None = None  # None: under the root


@dataclass(frozen=True)
class Command:
    """Network goals of one character for one frame."""

    places: np.ndarray  # [13, 2]
    directions: np.ndarray  # [13, 2]
    action: int
    active: bool
    seat: Seat | None = field(default=None)
    urgency: float = 0.0


def seat_of(figure: Figure, goal: Goal, body: Body) -> Seat:
    """The seat of a goal for a character at `body`: where to stand depends on the lying pose's open side."""
    positions, orientations = goal_arrays(figure, goal.pose)
    frame = figure.frame(torch.from_numpy(positions)[None])
    x, z = map(float, frame.origin[0])
    dx, dz = map(float, frame.direction[0])
    lying = goal.action == "lie"
    if lying:
        side = _open_side(goal, body, (x, z), (dx, dz))
        stand = (x + _LIE_ASIDE * side[0], z + _LIE_ASIDE * side[1], *side)
    else:
        ankles = positions[figure.contacts.numpy()[[0, 2]]][:, [0, 2]].mean(0)
        stand = (ankles[0] + _STAND_AHEAD * dx, ankles[1] + _STAND_AHEAD * dz, dx, dz)
    root = np.array([x, z, dx, dz], np.float32)
    return Seat(positions, orientations, root, np.array(stand, np.float32), lying)


def goal_arrays(figure: Figure, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Joint positions [J, 3] and world orientations [J, 3, 3] of a pose."""
    from character.rotation import quat_to_matrix

    local = quat_to_matrix(torch.tensor(np.asarray(pose.rotations, np.float32)))
    orientations = figure.world(local)
    hips = torch.tensor(np.asarray(pose.root_position, np.float32))
    return figure.positions(hips, orientations).numpy(), orientations.numpy()


def _open_side(goal: Goal, body: Body, root: tuple[float, float], facing: tuple[float, float]) -> tuple[float, float]:
    """Unit direction from the lying hips to where one can stand: square to the body, on the asked or the nearer
    side."""
    left = (facing[1], -facing[0])
    towards = (body.x - root[0], body.z - root[1]) if goal.approach is None else goal.approach
    sign = 1.0 if left[0] * towards[0] + left[1] * towards[1] >= 0 else -1.0
    return sign * left[0], sign * left[1]


def control(figure: Figure, state: Control, intent: Intent, body: Body) -> tuple[Control, Command]:
    """The controller's next memory and the network's goals."""
    state = replace(state, since=state.since + 1)
    if state.mode == INTERACT and _leaves(figure, state, intent, body):
        state = replace(state, mode=RISE, since=0)
    if state.mode == RISE and (_stands(state, body) or state.since > _RISE_LIMIT):
        state = Control(Plan(body.x, body.z, yaw=body.yaw))
    if state.mode == FREE:
        state = _approach(figure, state, intent, body)
    if state.mode == INTERACT and state.seat is not None:
        command = _hold(state.seat.root, ACTIONS.index("lie" if state.seat.lying else "sit"), state.seat)
        late = state.since - _LATE[int(state.seat.lying)]
        return state, replace(command, urgency=min(max(late / _URGENT, 0.0), 1.0))
    if state.mode == RISE and state.seat is not None:
        return state, _hold(state.seat.stand, ACTIONS.index("idle"), None)
    aim = _aim(state, intent, body)
    x, z = _anchor(aim, body)
    plan = follow(state.plan, aim, x, z, body.yaw, 1 / FRAME_RATE)
    places, directions = plan_keys(plan, aim)
    still = math.hypot(*(places[4] - places[0])) < 0.1 and float(directions[4] @ directions[0]) > 0.95
    # Off balance, or still under way: take a step.
    feet = body.feet or (body.x, body.z)
    still &= math.hypot(plan.vx, plan.vz) < 0.15 and math.hypot(feet[0] - body.x, feet[1] - body.z) < _BALANCED
    action = ACTIONS.index("idle" if still else "walk")
    return replace(state, plan=plan), Command(places, directions, action, False)


def _anchor(aim: Target | Steering, body: Body) -> tuple[float, float]:
    """Where the plan belongs: at the root, but when standing still over the feet, or they lean on each other."""
    stands = isinstance(aim, Steering) and math.hypot(aim.vx, aim.vz) < 0.05
    return body.feet if stands and body.feet is not None else (body.x, body.z)


def _leaves(figure: Figure, state: Control, intent: Intent, body: Body) -> bool:
    if not isinstance(intent, Goal) or state.seat is None:
        return True
    return not seat_of(figure, intent, body).same_as(state.seat)


def _stands(state: Control, body: Body) -> bool:
    if state.seat is None:
        return True
    apart = math.hypot(body.x - state.seat.stand[0], body.z - state.seat.stand[1])
    return body.height > _UPRIGHT and (apart < 0.2 or state.since > 2 * FRAME_RATE)


def _approach(figure: Figure, state: Control, intent: Intent, body: Body) -> Control:
    """Keeps the seat of the goal in mind, and begins the interaction on arrival."""
    if not isinstance(intent, Goal):
        return replace(state, seat=None, waiting=0)
    seat = state.seat
    if seat is None or state.since % FRAME_RATE == 0 or not seat_of(figure, intent, body).same_as(seat):
        seat = seat_of(figure, intent, body)
    stand = seat.stand
    apart = math.hypot(body.x - stand[0], body.z - stand[1])
    turned = abs(wrap(body.yaw - math.atan2(stand[2], stand[3])))
    waiting = state.waiting + 1 if apart < _CLOSE[0] and turned < _CLOSE[1] else 0
    if (apart < _ARRIVED[0] and turned < _ARRIVED[1]) or waiting > _PATIENCE:
        return replace(state, mode=INTERACT, seat=seat, since=0, waiting=0)
    return replace(state, seat=seat, waiting=waiting)


def _aim(state: Control, intent: Intent, body: Body) -> Target | Steering:
    if isinstance(intent, Goal) and state.seat is not None:
        x, z, dx, dz = map(float, state.seat.stand)
        yaw = math.atan2(dx, dz)
        centre = state.seat.positions[:, [0, 2]].mean(0) if state.seat.lying else state.seat.root[:2]
        return Target(x, z, yaw, (float(centre[0]), float(centre[1]), yaw))
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


def goals_of(figure: Figure, commands: list[Command]) -> Goals:
    """One batch of network goals."""
    joints = figure.joint_count
    rest = np.zeros((joints, 3), np.float32), np.broadcast_to(np.eye(3, dtype=np.float32), (joints, 3, 3))
    action = np.zeros((len(commands), 4), np.float32)
    action[np.arange(len(commands)), [c.action for c in commands]] = 1
    seats = [c.seat for c in commands]
    return Goals(
        positions=torch.from_numpy(np.stack([c.places for c in commands])),
        directions=torch.from_numpy(np.stack([c.directions for c in commands])),
        action=torch.from_numpy(action),
        active=torch.tensor([float(c.active) for c in commands]),
        pose_positions=torch.from_numpy(np.stack([s.positions if s else rest[0] for s in seats])),
        pose_orientations=torch.from_numpy(np.stack([s.orientations if s else rest[1] for s in seats])),
        urgency=torch.tensor([c.urgency for c in commands], dtype=torch.float32),
    )
