"""Actions that take a goal pose, by name."""

from roam_motion.actions import LIE, SIT, Action

GOAL_ACTIONS: dict[str, Action] = {action.name: action for action in (SIT, LIE)}
