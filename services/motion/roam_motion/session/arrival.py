"""When a character counts as having arrived."""

from dataclasses import dataclass

_SETTLED_FRAMES = 10  # this long near the goal and still: reached
_STILL = 0.002  # change of goal distance per frame [m]


@dataclass
class GoalWatch:
    """Says once per goal that the character has arrived and settled."""

    tolerance: float  # [m]
    near: int = 0
    last: float | None = None  # distance at the frame before [m]
    told: bool = False

    def restart(self) -> None:
        """A new goal was given."""
        self.near, self.last, self.told = 0, None, False

    def reached(self, distance: float | None) -> bool:
        """True on the frame at which the goal counts as reached."""
        if distance is None or self.told:
            return False
        steady = self.last is not None and abs(distance - self.last) < _STILL
        self.near, self.last = (self.near + 1 if steady and distance < self.tolerance else 0), distance
        self.told = self.near >= _SETTLED_FRAMES
        return self.told
