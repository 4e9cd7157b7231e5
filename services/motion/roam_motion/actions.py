"""The one table of actions: names, numbers in the protocol, columns of the networks. All else is derived from it.

`control/actions/` adds what a character does to take a goal pose; a further action is registered there, in one file.
"""

from dataclasses import dataclass

STYLES = ("idle", "walk", "sit", "lie")  # what networks are trained to tell apart: their style columns, in order
CARRIED = ("sit", "lie")  # of them, those in which furniture carries the body and not the feet


@dataclass(frozen=True)
class Action:
    """Something that a character does."""

    name: str  # in JSON, in files, in commands
    number: int  # in the protocol's enum `Action`
    style: str  # what a network is asked for meanwhile, one of `STYLES`

    @property
    def column(self) -> int:
        """Of its style, among the style columns."""
        return STYLES.index(self.style)


ACTIONS: dict[str, Action] = {}  # by name


def register(action: Action) -> Action:
    """Puts an action into the table. ValueError when its name or number is taken, or no network has its style."""
    if action.style not in STYLES:
        raise ValueError(f"action {action.name!r}: style {action.style!r} is none of the networks' {STYLES}")
    for other in ACTIONS.values():
        if action.name == other.name or action.number == other.number:
            raise ValueError(f"action {action.name!r} ({action.number}): {other.name!r} ({other.number}) is there")
    ACTIONS[action.name] = action
    return action


def action_numbered(number: int) -> Action | None:
    """The action with a number of the protocol, if there is one."""
    return next((action for action in ACTIONS.values() if action.number == number), None)


IDLE = register(Action("idle", 1, "idle"))
WALK = register(Action("walk", 2, "walk"))
SIT = register(Action("sit", 3, "sit"))
LIE = register(Action("lie", 4, "lie"))
