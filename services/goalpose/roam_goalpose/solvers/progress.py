"""What a solver tells while it runs, and how it is stopped."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from roam_character.pose import Pose

from roam_goalpose.objects.own_axes import Placement

STAGES = ("preparing", "root", "joints", "joints with priors")


class Cancelled(Exception):  # noqa: N818 (a request, not an error)
    """The caller asked to stop; nothing was produced."""


@dataclass(frozen=True, eq=False)
class Progress:
    """One iteration of the best candidate so far."""

    stage: int  # 0 preparing, then the paper's 1..3
    iteration: int
    iteration_count: int  # of the whole run
    energy: float
    pose: Pose | None

    def placed(self, placement: Placement) -> "Progress":
        """The same with the pose in the object's world."""
        return self if self.pose is None else replace(self, pose=placement.to_world(self.pose))

    @property
    def stage_name(self) -> str:
        """Name of the stage, for people."""
        return STAGES[self.stage]


Listener = Callable[[Progress], None]


@dataclass(frozen=True)
class Watch:
    """Reports progress and checks for cancellation."""

    listener: Listener | None = None
    cancelled: Callable[[], bool] | None = None

    def check(self) -> None:
        """Raises Cancelled when the caller asked to stop."""
        if self.cancelled is not None and self.cancelled():
            raise Cancelled

    def tell(self, progress: Callable[[], Progress]) -> None:
        """Checks, then reports; the pose is made only when someone listens."""
        self.check()
        if self.listener is not None:
            self.listener(progress())
