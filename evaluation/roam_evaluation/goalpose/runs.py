"""One goal pose, judged against the object as it is, and kept as a record."""

import math
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from functools import cache
from typing import Any

import numpy as np
import torch
from roam_character.body import body_capsules
from roam_character.pose import Pose
from roam_character.skeleton import humanoid_skeleton
from roam_goalpose.energy.body import body_points, penetration_depths
from roam_goalpose.energy.figure import Figure, figure_from_pose
from roam_goalpose.objects import Shape
from roam_goalpose.references.model import height_above_surface
from roam_goalpose.references.pairs import ReferencePair
from roam_goalpose.synthesis import GoalPoseRequest, GoalPoseResult, Synthesizer

from roam_evaluation.goalpose.inputs.cases import Case
from roam_evaluation.goalpose.inputs.objects import ONE_SEAT

HIP, HEADING = 0.08, math.radians(20)  # docs/concepts/success.md
STRICT_HIP, STRICT_HEADING, STRICT_DEPTH, STRICT_FLOOR = 0.05, math.radians(15), 0.03, 0.03  # docs/concepts/success.md
# [m] With level thighs and flat soles the knees of a person of 1.69 m are at 0.50 m, the undersides of thighs 0.07 m
# lower; pressed in as deep as allowed they lie on an edge of this height. From a higher one feet hang, by as much.
HIGHEST_LEVEL_EDGE = 0.50 - 0.07 + STRICT_DEPTH


@dataclass(frozen=True)
class Run:
    """One pose, judged. Everything in it can be written as JSON."""

    object: str
    category: str
    subtype: str
    variant: str  # what was done to the upload or to the energy; "plain"
    initial_yaw: float | None  # [rad]
    reference: str
    hip_distance: float | None  # [m] to the nearest plausible place; None: the object has no seat to judge by
    lateral: float  # [m] of the hip from the object's middle plane
    heading_error: float | None  # [rad]; None: the object has no front
    penetration: float  # [m] of the deepest capsule in the object as it is
    bone_depths: dict[str, float]  # [m] of the bones that are in it
    floor: float | None  # [m] of the worse sole; None: the reference does not stand on the floor
    hang: float  # [m] by which the feet must be off the floor because the seat's front edge is high
    seconds: float
    cpu_seconds: float
    turn_error: float | None  # [m] largest joint distance to the pose on the plain upload
    warnings: tuple[str, ...]
    diagnostics: dict[str, float]
    energies: dict[str, float]
    root_position: list[float]  # [3] [m], on the canonical object
    rotations: list[list[float]]  # [J, 4]

    @property
    def success(self) -> bool:
        """Issue 2: hip within 8 cm of a plausible seat point, heading within 20 degrees."""
        hip = self.hip_distance is not None and self.hip_distance <= HIP
        return hip and (self.heading_error is None or self.heading_error <= HEADING)

    @property
    def strict(self) -> bool:
        """Issue 3: 5 cm, 15 degrees, no capsule deeper than 3 cm, feet within 3 cm of the floor or where they hang."""
        floor = self.floor is None or self.floor <= STRICT_FLOOR + self.hang
        return self._close and floor

    @property
    def strict_flat(self) -> bool:
        """The same with the feet within 3 cm of the floor itself on every seat, bar stools too."""
        return self._close and (self.floor is None or self.floor <= STRICT_FLOOR)

    @property
    def _close(self) -> bool:
        """Issue 3's limits but that of the feet."""
        hip = self.hip_distance is not None and self.hip_distance <= STRICT_HIP
        heading = self.heading_error is None or self.heading_error <= STRICT_HEADING
        return hip and heading and self.penetration <= STRICT_DEPTH

    @property
    def pose(self) -> Pose:
        """The pose, on the canonical object."""
        return Pose(humanoid_skeleton(), np.array(self.root_position, np.float32), np.array(self.rotations, np.float32))

    def record(self) -> dict[str, Any]:
        """For JSON."""
        values: dict[str, Any] = rounded(asdict(self))
        return values | {"success": self.success, "strict": self.strict, "strict_flat": self.strict_flat}

    def line(self) -> str:
        """For the terminal."""
        hip = "  no seat" if self.hip_distance is None else f"hip {100 * self.hip_distance:4.1f} cm"
        heading = "   -" if self.heading_error is None else f"{math.degrees(self.heading_error):4.0f}"
        turn = "" if self.turn_error is None else f" turned {100 * self.turn_error:.1f} cm"
        mark = "STRICT" if self.strict else "ok    " if self.success else "BAD   "
        return (
            f"{mark} {self.reference:13} {hip} lateral {100 * self.lateral:4.0f} heading {heading} "
            f"deep {100 * self.penetration:4.1f} {self.cpu_seconds:4.1f} s{turn}"
        )


def run_from(record: dict[str, Any]) -> Run:
    """A run from its record."""
    return Run(**{field.name: record[field.name] for field in fields(Run)})


def runs_from(records: Iterable[dict[str, Any]]) -> list[Run]:
    """Runs from their records."""
    return [run_from(record) for record in records]


def rounded(value: Any) -> Any:
    """Four digits after the point: tenths of millimetres, hundredths of degrees."""
    if isinstance(value, float):
        return round(value, 4)
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    return [rounded(item) for item in value] if isinstance(value, list | tuple) else value


def run_case(
    synthesizer: Synthesizer, case: Case, request: GoalPoseRequest, *, variant: str = "plain", beside: Run | None = None
) -> Run:
    """Asks for a pose on what is given and judges it on the truth; `beside`: the run on the plain upload."""
    began = time.thread_time()
    result = synthesizer.synthesize(case.given, request)
    return judge(
        case,
        result,
        expected_hip=hip_height_of(synthesizer.references[result.reference]),
        variant=variant,
        initial_yaw=request.initial_yaw,
        cpu_seconds=time.thread_time() - began,
        beside=beside,
    )


def judge(
    case: Case,
    result: GoalPoseResult,
    *,
    expected_hip: float,
    variant: str,
    initial_yaw: float | None,
    cpu_seconds: float,
    beside: Run | None,
) -> Run:
    """Measures of one answer. `expected_hip` [m]: height of the reference's hips joint over its seat."""
    pose = case.brought_back(result.pose)
    hip = pose.positions()[0]
    depths = bone_depths(pose, case.truth)
    region, item = case.region, case.item
    has_front = region is not None and region.has_back and item.category not in ("stool", "barstool")
    edge = item.seat_height or 0.0 if region is None else region.edge - case.truth.floor_height
    apart = None if beside is None else np.linalg.norm(pose.positions() - beside.pose.positions(), axis=-1).max()
    return Run(
        object=item.name,
        category=item.category,
        subtype=item.subtype,
        variant=variant,
        initial_yaw=initial_yaw,
        reference=result.reference,
        hip_distance=None if region is None else region.distance(hip, expected_hip),
        lateral=abs(float(hip[0] - case.truth.bounds[:, 0].mean())) if item.category in ONE_SEAT else 0.0,
        heading_error=abs(math.remainder(pose.yaw(), 2 * math.pi)) if has_front else None,
        penetration=max(depths.values(), default=0.0),
        bone_depths=depths,
        floor=result.diagnostics.get("floor_distance"),
        hang=max(0.0, edge - HIGHEST_LEVEL_EDGE),
        seconds=result.seconds,
        cpu_seconds=cpu_seconds,
        turn_error=None if apart is None else float(apart),
        warnings=tuple(warning.reason for warning in result.warnings),
        diagnostics=result.diagnostics,
        energies=result.energies,
        root_position=pose.root_position.tolist(),
        rotations=pose.rotations.tolist(),
    )


def figure_of_pose(pose: Pose) -> Figure:
    """A pose as a batch of one, for the energy's functions."""
    return figure_from_pose(
        pose.skeleton, torch.as_tensor(pose.root_position)[None], torch.as_tensor(pose.rotations)[None]
    )


def bone_depths(pose: Pose, shape: Shape) -> dict[str, float]:
    """How deep every bone's capsule lies in the object [m]; only bones that are in it."""
    capsules = body_capsules(pose.skeleton)
    body = body_points(capsules)
    with torch.no_grad():
        depths = penetration_depths(figure_of_pose(pose), body, shape.distance)[0].numpy()
    deepest = {name: float(depths[body.capsule.numpy() == c].max()) for c, name in enumerate(capsules.names)}
    return {name: depth for name, depth in deepest.items() if depth > 0}


@cache
def hip_height_of(pair: ReferencePair) -> float:
    """Height of the reference's hips joint over the seat below it [m]."""
    return height_above_surface(pair.shape.distance, torch.as_tensor(pair.pose.root_position))
