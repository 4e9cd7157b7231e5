"""What a synthesis answers: ranked poses in the object's world, and what there is to say about each."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from roam_character.pose import Pose
from torch import Tensor

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


APART = 0.35  # [m] hips further from each other than this are on different places
ASIDE = 0.8  # [rad] headings further from each other than this differ
TAKEN = 0.25  # by how much worse a pose counts for every better one that sits where it sits ...
ELBOWS = 0.45  # [m] ... and by how much less the further their hips are from each other, until it is nothing here
WORST = 0.6  # poses whose energy is that much above the best are no choice


def choose_diverse(candidates: Candidates, count: int) -> Tensor:
    """Indices of up to `count` candidates: the best first, then those that are good and unlike the ones before.

    A pose like an earlier one in place, heading and reference is never chosen; one that shares only the place can be,
    when no other place is nearly as good.
    """
    root, yaw = candidates.figure.root_position, facing_yaw(candidates.figure)
    turn = yaw[:, None] - yaw[None]
    between = torch.linalg.vector_norm(root[:, None] - root[None], dim=-1)
    crowded = TAKEN * (1.5 * (1.0 - between / ELBOWS)).clamp(0.0, 1.0)  # fading: a limit would hang on a centimetre
    alike = (between < APART) & (torch.atan2(turn.sin(), turn.cos()).abs() < ASIDE)
    same = alike & (candidates.reference[:, None] == candidates.reference[None])
    score = candidates.fit.clone()
    best = float(score.min())
    chosen: list[int] = []
    while len(chosen) < count and float(score.min()) < float("inf"):
        index = int(score.argmin())
        chosen.append(index)
        score = torch.where(same[index], torch.inf, score + crowded[index])
        score[candidates.fit > best + WORST] = torch.inf
    return torch.tensor(chosen)
