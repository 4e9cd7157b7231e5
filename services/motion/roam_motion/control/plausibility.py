"""Whether a goal is one that a body can take where it is: in, on and near its furniture, and to be reached on foot.

A goal that is none of that is refused when it is sent. Later there is nobody left to tell: the character would fly, or
the step that it is part of would fail.
"""

from dataclasses import dataclass

import numpy as np
import torch

from roam_motion.animation.collision import furniture_of
from roam_motion.animation.figure import Figure
from roam_motion.control.actions import GOAL_ACTIONS, outlines_of, seat_of
from roam_motion.control.intent import Goal
from roam_motion.control.paths import Place, reachable
from roam_motion.control.seat import Posture, goal_arrays

# Shares of the leg's length (hips to ankle).
_HIGHEST_HIPS = 1.6  # above the floor; 954 goal poses: at most 1.3, on bar stools; an upper berth (2.0) needs a ladder
_DEEPEST = 0.5  # under the floor, of any joint
_OFF_FURNITURE = 0.35  # [m] from the hips joint to the matter that carries it, flesh and grid included: chosen wide


class ImplausibleGoalError(ValueError):
    """Says what is wrong with a goal and what to do; `field` is the goal's member at fault."""

    def __init__(self, field: str, detail: str) -> None:
        super().__init__(detail)
        self.field = field


class UnreachableGoalError(ValueError):
    """There is no way to the goal."""


@dataclass(frozen=True)
class _Measures:
    hips: np.ndarray  # [3] [m]
    lowest: float  # joint [m]
    posture: Posture
    leg: float  # [m]


def check_goal(figure: Figure, goal: Goal, start: Place) -> None:
    """ImplausibleGoalError or UnreachableGoalError for a goal of a character at `start` on a floor at height 0.

    Metres; the goal's own `moved` to that floor. Also prepares the goal as the controller will: what fails there
    is an ImplausibleGoalError too.
    """
    measures = _measures(figure, goal)
    _check_heights(measures)
    _check_posture(goal, measures)
    _check_furniture(goal, measures.hips)
    try:
        seat = seat_of(figure, goal, start)
        outlines = outlines_of(figure, goal)
    except Exception as error:  # whatever it is, it would otherwise happen in the step of all characters
        raise ImplausibleGoalError("pose", f"no place to stand before it can be found ({error})") from error
    x, z, dx, dz = map(float, seat.stand)
    if goal.obstacles and not reachable(start, (x, z), (dx, dz), outlines):
        detail = f"obstacles shut off the way from ({start[0]:.2f}, {start[1]:.2f}) to ({x:.2f}, {z:.2f})"
        raise UnreachableGoalError(detail)


def _measures(figure: Figure, goal: Goal) -> _Measures:
    positions, _ = goal_arrays(figure, goal.pose)
    name = figure.skeleton.index
    hips, neck = positions[0], positions[name("neck")]
    ankles = positions[[name("leftFoot"), name("rightFoot")]]
    rest = goal_rest_leg(figure)
    up = neck - hips
    trunk = float(np.degrees(np.arccos(np.clip(up[1] / max(float(np.linalg.norm(up)), 1e-6), -1.0, 1.0))))
    hang = float(hips[1] - ankles[:, 1].mean()) / rest
    return _Measures(hips, float(positions[:, 1].min()), Posture(trunk, hang), rest)


def goal_rest_leg(figure: Figure) -> float:
    """Hips joint to ankle of the standing skeleton [m]."""
    offsets, parents = figure.skeleton.rest_offsets, figure.skeleton.parents
    joint, length = figure.skeleton.index("leftFoot"), 0.0
    while parents[joint] > 0:
        length += float(np.linalg.norm(offsets[joint]))
        joint = parents[joint]
    return length


def _check_heights(measures: _Measures) -> None:
    height, most = float(measures.hips[1]), _HIGHEST_HIPS * measures.leg
    advice = "send heights above the same floor as the session's floor_height"
    if height > most:
        detail = f"the hips are {height:.2f} m above the session's floor, {most:.2f} m can be reached; {advice}"
        raise ImplausibleGoalError("pose.root_position", detail)
    if measures.lowest < -_DEEPEST * measures.leg:
        detail = f"the pose reaches {-measures.lowest:.2f} m under the session's floor; {advice}"
        raise ImplausibleGoalError("pose.root_position", detail)


def _check_posture(goal: Goal, measures: _Measures) -> None:
    objection = GOAL_ACTIONS[goal.action].objection(measures.posture)
    if objection:
        raise ImplausibleGoalError("action", objection)


def _check_furniture(goal: Goal, hips: np.ndarray) -> None:
    if goal.volume is None:
        return
    furniture = furniture_of([goal.volume], [np.zeros(0, np.float32)], [True])
    gap, _ = furniture.distance(torch.tensor(hips, dtype=torch.float32)[None, None])
    away = _outside(goal, hips)
    if away > 0 or not float(gap) < _OFF_FURNITURE:
        where = f"{away:.1f} m outside the volume" if away > 0 else f"{float(gap):.2f} m from the volume's furniture"
        detail = f"the pose's hips are {where}; move pose, volume and obstacles together"
        raise ImplausibleGoalError("volume", detail)


def _outside(goal: Goal, hips: np.ndarray) -> float:
    """How far the hips are outside the volume's grid [m]; half a metre of air above a seat still belongs to it."""
    volume = goal.volume
    assert volume is not None
    cos, sin = np.cos(volume.yaw), np.sin(volume.yaw)
    x, y, z = (np.asarray(hips, float) - volume.origin).tolist()
    own = np.array([cos * x - sin * z, y, sin * x + cos * z])
    extent = volume.pitch * (np.array(volume.values.shape) - 1)
    slack = np.array([_OFF_FURNITURE, 0.5, _OFF_FURNITURE])
    return float(np.linalg.norm(np.maximum(np.maximum(-own, own - extent) - slack, 0.0)))
