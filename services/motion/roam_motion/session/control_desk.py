"""What a control has to pass before a session takes it: is it plausible, and can the server afford to keep it?"""

import asyncio
import hashlib
from collections.abc import Callable
from dataclasses import replace
from weakref import WeakValueDictionary

import numpy as np
from roam_character.volume import Volume
from roam_serving.errors import ServiceError
from roam_serving.rates import RateLimiter

from roam_motion.control.intent import Goal, Idle, Intent, Steer
from roam_motion.control.pace import cut_to
from roam_motion.control.paths import Outline, Place, inside
from roam_motion.control.plausibility import ImplausibleGoalError, UnreachableGoalError
from roam_motion.errors import CONTROL_BUDGET, GOAL_INVALID, GOAL_UNREACHABLE
from roam_motion.session.ownership import LiveSessions
from roam_motion.session.records import ControlEntry, ControlRequest, Event, EventKind
from roam_motion.session.session import Session
from roam_motion.settings import MotionSettings

_BURST = 2.0  # [s] of controls that may come at once
_SAME_SEAT = 0.3  # [m] between two pairs of hips: a body is 0.35 m wide


class ControlDesk:
    """Checks controls before they are written down; all methods run on the event loop.

    `left_behind(intent)` are the outlines that whoever was asked for it keeps out of when steered from then on.
    `check_goal(goal, start)` raises an ImplausibleGoalError or UnreachableGoalError; it runs in a thread.
    """

    def __init__(
        self,
        live: LiveSessions,
        settings: MotionSettings,
        check_goal: Callable[[Goal, Place], None],
        left_behind: Callable[[Intent], tuple[Outline, ...]],
    ) -> None:
        self._live, self._settings, self._check_goal, self._left_behind = live, settings, check_goal, left_behind
        rate = settings.controls_per_second
        self._rates = RateLimiter(rate, max(1, round(_BURST * rate)))
        self._goals: WeakValueDictionary[str, Goal] = WeakValueDictionary()
        self._volumes: WeakValueDictionary[str, Volume] = WeakValueDictionary()

    async def checked(self, session: Session, control: ControlRequest) -> tuple[ControlRequest, list[Event]]:
        """The control above the animator's floor, its goal shared with equal ones, and what there is to warn of.

        RATE_LIMITED; GOAL_INVALID and GOAL_UNREACHABLE say what is wrong with the goal.
        """
        self._rates.take(session.name)
        control = replace(control, change=control.change.lowered(session.floor_height))
        lowered = control.change.intent
        if isinstance(lowered, Steer | Idle):
            lowered = replace(lowered, around=self._left_behind(session.newest_intent))
            control = replace(control, change=replace(control.change, intent=lowered))
        if isinstance(lowered, Steer) and (kept := cut_to(lowered)) is not None:
            return control, [_warning("SPEED_CUT", f"so fast nobody walks; followed at {kept:.2f} m/s")]
        if not isinstance(lowered, Goal):
            return control, []
        try:
            await asyncio.to_thread(self._check_goal, lowered, session.place)
        except ImplausibleGoalError as error:
            raise ServiceError(GOAL_INVALID, str(error), field=f"control.goal.{error.field}") from error
        except UnreachableGoalError as error:
            raise ServiceError(GOAL_UNREACHABLE, str(error), field="control.goal.obstacles") from error
        change = replace(control.change, intent=self._shared(lowered))
        return replace(control, change=change), self._warnings(session, lowered)

    def afford(self, session: Session, entry: ControlEntry) -> None:
        """CONTROL_BUDGET when the session or its caller has as many bytes of controls kept as it may have."""
        size, history = entry.change.size, self._settings.history_frames + self._settings.snapshot_frames
        own = session.kept_bytes(history)
        others = sum(
            other.kept_bytes(history) for other in self._live if other.caller == session.caller and other is not session
        )
        for kept, most, whose in (
            (own, self._settings.control_bytes, "session"),
            (own + others, self._settings.caller_bytes, "caller"),
        ):
            if kept + size > most:
                detail = f"{kept + size:,} bytes of controls within {history} frames; a {whose} may have {most:,}"
                raise ServiceError(CONTROL_BUDGET, detail, retry_after=1.0)

    def _shared(self, goal: Goal) -> Goal:
        """The goal that is equal to this one and there already, or this one."""
        if goal.volume is not None:
            goal = replace(goal, volume=self._volumes.setdefault(goal.volume.digest, goal.volume))
        return self._goals.setdefault(_digest(goal), goal)

    def _warnings(self, session: Session, goal: Goal) -> list[Event]:
        """About a goal lowered to the animator's floor."""
        found = []
        if inside(session.place, goal.obstacles) and not isinstance(session.intent, Goal):
            found.append(_warning("START_IN_FURNITURE", "the character stands inside an obstacle of the goal"))
        taken = [other.name for other in self._live if other is not session and _same_seat(session, goal, other)]
        if taken:
            found.append(_warning("SEAT_TAKEN", f"{taken[0]} is on its way to this place or sits there"))
        return found


def _warning(reason: str, message: str) -> Event:
    return Event(EventKind.WARNING, message=message, reason=reason)


def _same_seat(session: Session, goal: Goal, other: Session) -> bool:
    if other.record.owner != session.record.owner or not isinstance(other.intent, Goal):
        return False
    apart = goal.pose.root_position - other.intent.pose.root_position
    apart[1] += session.floor_height - other.floor_height
    return bool(np.linalg.norm(apart) < _SAME_SEAT)


def _digest(goal: Goal) -> str:
    arrays = goal.pose.root_position, goal.pose.rotations, goal.approach, goal.look_at
    parts = [None if array is None else np.ascontiguousarray(array, np.float32).tobytes() for array in arrays]
    named = goal.pose.skeleton.id, goal.action, goal.obstacles, goal.volume.digest if goal.volume else ""
    return hashlib.sha256(repr((named, parts)).encode()).hexdigest()
