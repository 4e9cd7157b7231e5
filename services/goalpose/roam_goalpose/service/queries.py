"""What callers ask of the service and what they get, in its own types: no wire format is known here."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from roam_character.skeleton import Skeleton
from roam_character.volume import Volume

from roam_goalpose.assessment.quality import PoseQuality, quality_of
from roam_goalpose.energy.constraints import NONE, Constraints
from roam_goalpose.objects import Shape
from roam_goalpose.objects.footprint import footprint
from roam_goalpose.objects.volume import shape_volume
from roam_goalpose.synthesis import GoalPoseRequest, GoalPoseResult


@dataclass(frozen=True, eq=False)
class StoredObject:
    """An uploaded object and the format of its file."""

    shape: Shape
    format: str


@dataclass(frozen=True)
class PoseQuery:
    """A request for a goal pose: what, besides the weights of the networks, decides the answer."""

    object: str = ""  # its name
    points: NDArray[np.float32] | None = None  # [N, 3] [m], +Y up, instead of an object
    reference: str = ""  # id, or "" with an action
    action: str = ""
    initial_yaw: float | None = None
    restarts: int = 0
    seed: int = 0
    solver: str = "default"
    count: int = 1
    constraints: Constraints = NONE
    weights: tuple[tuple[str, float], ...] = ()
    skeleton: Skeleton | None = None  # the caller's own, instead of that of the reference poses
    skeleton_id: str = ""  # the skeleton that the caller expects, or ""

    @property
    def key(self) -> Mapping[str, Any]:
        """What the answer depends on, as JSON; once points have become an object."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("points", "skeleton_id")}
        values["constraints"] = asdict(self.constraints)
        values["skeleton"] = None if self.skeleton is None else self.skeleton.id
        return values


@dataclass(frozen=True, eq=False)
class GivenReference:
    """A pose that a caller puts on an uploaded object, in that object's world."""

    object: str
    action: str
    title: str
    skeleton_id: str  # "": the default one
    root_position: NDArray[np.float32]  # [3] [m]
    rotations: NDArray[np.float32]  # [J, 4] xyzw, of unit length


@dataclass(frozen=True, eq=False)
class GoalPose:
    """The answer to one query: ranked poses with their qualities, and the object as motion needs it."""

    result: GoalPoseResult
    qualities: tuple[PoseQuality, ...]  # of `result.poses`
    outlines: tuple[NDArray[np.float64], ...]  # of what the object covers of the floor, [K, 2] each (x, z) [m]
    volume: Volume
    skeleton: Skeleton | None = None  # of the poses, when the caller brought it


@dataclass(frozen=True, eq=False)
class Answer:
    """The end of a synthesis."""

    goal_pose: GoalPose
    cached: bool


def goal_pose_of(result: GoalPoseResult, shape: Shape, request: GoalPoseRequest) -> GoalPose:
    """The answer to `request` on the object `shape`."""
    weight = request.weight_of("descriptor")
    return GoalPose(
        result=result,
        qualities=tuple(quality_of(ranked, shape, descriptor_weight=weight) for ranked in result.poses),
        outlines=tuple(footprint(shape.points)),
        volume=shape_volume(shape),
        skeleton=request.skeleton,
    )
