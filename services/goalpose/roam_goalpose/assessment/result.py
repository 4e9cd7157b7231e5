"""What a synthesis answers: ranked poses in the object's world, and what there is to say about each."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from roam_character.pose import Pose

from roam_goalpose.assessment.diagnostics import PoseWarning, bone_depths, diagnose, warn
from roam_goalpose.energy.reference import ReferenceModel
from roam_goalpose.energy.scene import Target
from roam_goalpose.objects.own_axes import Placement
from roam_goalpose.references.pairs import ReferencePair
from roam_goalpose.solvers.candidates import Candidates, facing_yaw

Point = tuple[float, float, float]


@dataclass(frozen=True)
class CandidateSummary:
    """One of the placements that were optimised to the end."""

    energy: float
    root_position: Point
    heading: float  # [rad]


@dataclass(frozen=True, eq=False)
class RankedPose:
    """One of several poses on an object, in the object's world."""

    pose: Pose
    place: Point  # below the hips, on the object's surface [m]
    reference: str
    action: str
    energies: dict[str, float]  # weighted terms and "total"
    diagnostics: dict[str, float]
    bone_depths: dict[str, float]  # deepest capsule of every bone in the object [m]; only bones that are in it
    warnings: tuple[PoseWarning, ...]


@dataclass(frozen=True, eq=False)
class GoalPoseResult:
    """The best pose, in the object's world."""

    name: str  # "goalPoses/sha256:…" of request, object and model
    pose: Pose
    energies: dict[str, float]  # weighted terms and "total"
    diagnostics: dict[str, float]
    warnings: tuple[PoseWarning, ...]
    reference: str
    action: str
    floor_height: float
    object: str
    seconds: float
    candidates: tuple[CandidateSummary, ...]
    poses: tuple[RankedPose, ...] = ()  # best first, beginning with `pose`; as many as there are, at most `count`


def ranked_pose(
    found: Candidates, pairs: list[ReferencePair], model: ReferenceModel, target: Target, placement: Placement
) -> RankedPose:
    """The first of the candidates with its measures; `model` is the one reference it was made from."""
    pair = pairs[int(found.reference[0])]
    values = diagnose(found.figure, model, target)
    pose = found.pose()
    below = pose.root_position - [0.0, values["hip_height"], 0.0]
    values["heading"] = math.remainder(values["heading"] + placement.yaw, 2 * math.pi)
    return RankedPose(
        pose=placement.to_world(pose),
        place=_point(placement.point_to_world(below)),
        reference=pair.id,
        action=pair.action,
        energies={name: float(term[0]) for name, term in found.terms.items()} | {"total": float(found.energy[0])},
        diagnostics=values,
        bone_depths=bone_depths(found.figure, model, target),
        warnings=warn(values),
    )


def summaries(found: Candidates, placement: Placement) -> tuple[CandidateSummary, ...]:
    """All candidates in short."""
    yaws = facing_yaw(found.figure) + placement.yaw
    roots = [_point(placement.point_to_world(root)) for root in found.figure.root_position.numpy()]
    return tuple(CandidateSummary(float(e), r, float(y)) for e, r, y in zip(found.energy, roots, yaws, strict=True))


def _point(values: npt.NDArray[np.floating]) -> Point:
    x, y, z = (float(v) for v in values)
    return x, y, z
