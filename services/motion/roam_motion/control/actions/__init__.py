"""Actions that take a goal pose: what each has to know, and the table of them.

A further one is a module with a class like `Sit`, and one line in the table below (or a call of `register`).
"""

from functools import lru_cache
from typing import Protocol

import numpy as np

from roam_motion import actions
from roam_motion.actions import LIE, SIT, Action
from roam_motion.animation.figure import Figure
from roam_motion.control.actions.lie import Lie
from roam_motion.control.actions.sit import Sit
from roam_motion.control.intent import Goal
from roam_motion.control.paths import Outline, Place
from roam_motion.control.seat import Posture, Seat, Transition


class GoalAction(Protocol):
    """How a goal pose is approached, taken and left. Asked every frame: what takes long is worked out once per goal."""

    def seat(self, figure: Figure, goal: Goal, place: Place) -> Seat:
        """The goal pose and the place to stand before and after it, for a character at `place` (x, z) [m]."""

    def objection(self, posture: Posture) -> str | None:
        """Why a body in this posture does something else; None where it fits the action."""

    def room(self, figure: Figure, goal: Goal) -> Outline:
        """The floor that the pose takes up, which ways go round where the client sends no obstacles."""

    def footing(self, figure: Figure, seat: Seat) -> np.ndarray | None:
        """Where both ankles belong (x, z) [m] and their feet point, as it begins [2, 4]; None: under the body."""

    def transition(self, figure: Figure, seat: Seat, manner: tuple[float, ...]) -> Transition | None:
        """The planned way into the pose and out of it for somebody of a manner (see manner.py); None where the motion
        model finds it by itself."""


GOAL_ACTIONS: dict[str, GoalAction] = {SIT.name: Sit(), LIE.name: Lie()}  # by the action's name


def register(action: Action, goal_action: GoalAction) -> None:
    """Makes a further action known everywhere. ValueError when its name or number is taken."""
    actions.register(action)
    GOAL_ACTIONS[action.name] = goal_action


def seat_of(figure: Figure, goal: Goal, place: Place) -> Seat:
    """The seat of a goal for a character at `place`."""
    return GOAL_ACTIONS[goal.action].seat(figure, goal, place)


@lru_cache(maxsize=512)
def outlines_of(figure: Figure, goal: Goal) -> tuple[Outline, ...]:
    """What the way to a goal goes round: its obstacles, or the room that its pose takes up."""
    return goal.obstacles or (GOAL_ACTIONS[goal.action].room(figure, goal),)


def footing(figure: Figure, seat: Seat) -> np.ndarray | None:
    """Where the feet belong as a seat is taken [2, 4]; see `GoalAction`."""
    return GOAL_ACTIONS[seat.action].footing(figure, seat)


def transition(figure: Figure, seat: Seat, manner: tuple[float, ...] = ()) -> Transition | None:
    """The planned way into a seat, if there is one, for somebody of a manner."""
    return GOAL_ACTIONS[seat.action].transition(figure, seat, manner)
