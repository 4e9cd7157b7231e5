"""What a caller may ask for besides a good pose: where to sit, where to face, where the hands go."""

from dataclasses import dataclass, replace

import numpy as np

from roam_goalpose.objects.own_axes import Placement

Point = tuple[float, float, float]
HANDS = ("left", "right")


@dataclass(frozen=True, kw_only=True)
class Constraints:
    """Wishes of the caller, in world coordinates; whatever is None or empty is free."""

    seat_point: Point | None = None  # [m] the hips go above it; its height only chooses the surface
    facing: float | None = None  # [rad] heading of the pelvis
    hands: tuple[tuple[str, Point], ...] = ()  # "left" or "right", and where the middle of that hand goes [m]

    @property
    def given(self) -> bool:
        """Whether there are any."""
        return self.seat_point is not None or self.facing is not None or bool(self.hands)

    @property
    def rigid(self) -> "Constraints":
        """Those that moving the whole body can meet: nobody slides along a bench to reach an arm rest."""
        return replace(self, hands=())


NONE = Constraints()


def constraints_in(wishes: Constraints, placement: Placement) -> Constraints:
    """The wishes in the object's own axes."""

    def own(point: Point) -> Point:
        x, y, z = (float(v) for v in placement.point_to_own(np.array(point)))
        return x, y, z

    return Constraints(
        seat_point=None if wishes.seat_point is None else own(wishes.seat_point),
        facing=None if wishes.facing is None else wishes.facing - placement.yaw,
        hands=tuple((side, own(goal)) for side, goal in wishes.hands),
    )
