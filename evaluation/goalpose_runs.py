"""One object, several requests: poses, their measures, and the picture."""

import io
import math
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh
from character.rotation import quat_from_yaw, quat_rotate
from goalpose.energy.weights import DEFAULT, EnergyWeights
from goalpose.objects import ObjectError, Shape, format_of, load_shape
from goalpose.solver import SolverConfig
from goalpose.synthesis import GoalPoseRequest, GoalPoseResult, Synthesizer, SynthesizerSettings

from evaluation.goalpose_objects import ONE_SEAT, EvaluationObject
from evaluation.picture import Pixels, body_splats, cloud_splats, mark_deep, object_splats, scene_views
from evaluation.seat_region import SeatRegion, seat_region

Array = npt.NDArray[np.floating]

HIP, HEADING = 0.08, math.radians(20)  # issue 2
STRICT_HIP, STRICT_HEADING, STRICT_DEPTH, STRICT_FLOOR = 0.05, math.radians(15), 0.03, 0.03


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What to ask for every object."""

    headings: tuple[float, ...]
    turned: int
    reference: str | None
    action: str
    solver: str
    terms: str
    weights: Path | None
    pictures: bool


@dataclass(frozen=True, eq=False)
class Run:
    """One pose, judged."""

    object: str
    category: str
    subtype: str
    initial_yaw: float
    reference: str
    hip_distance: float | None  # [m] to the nearest plausible place; None: the object has no seat to judge by
    lateral: float  # [m] of the hip from the object's middle plane
    heading_error: float | None  # [rad]; None: the object has no front
    penetration: float  # [m]
    floor: float | None  # [m]
    seconds: float
    cpu_seconds: float
    turn_error: float | None  # [m] largest joint distance between the poses on the turned and the unturned upload
    warnings: tuple[str, ...]
    diagnostics: dict[str, float]
    energies: dict[str, float]
    picture: Pixels | None = None

    @property
    def success(self) -> bool:
        """Issue 2: hip within 8 cm of a plausible seat point, heading within 20 degrees."""
        hip = self.hip_distance is not None and self.hip_distance <= HIP
        return hip and (self.heading_error is None or self.heading_error <= HEADING)

    @property
    def strict(self) -> bool:
        """Issue 3: 5 cm, 15 degrees, no capsule deeper than 3 cm, feet within 3 cm of the floor."""
        hip = self.hip_distance is not None and self.hip_distance <= STRICT_HIP
        heading = self.heading_error is None or self.heading_error <= STRICT_HEADING
        floor = self.floor is None or self.floor <= STRICT_FLOOR
        return hip and heading and floor and self.penetration <= STRICT_DEPTH

    def record(self) -> dict[str, Any]:
        """For JSON."""
        values = {k: v for k, v in vars(self).items() if k != "picture"}
        return {k: round(v, 4) if isinstance(v, float) else v for k, v in values.items()} | {
            "success": self.success,
            "strict": self.strict,
            "diagnostics": {k: round(v, 4) for k, v in self.diagnostics.items()},
            "energies": {k: round(v, 4) for k, v in self.energies.items()},
        }

    def line(self) -> str:
        """For the terminal."""
        hip = "  no seat" if self.hip_distance is None else f"hip {100 * self.hip_distance:4.1f} cm"
        heading = "   -" if self.heading_error is None else f"{math.degrees(self.heading_error):4.0f}"
        turn = "" if self.turn_error is None else f" turned {100 * self.turn_error:.1f} cm"
        mark = "ok " if self.success else "BAD"
        return (
            f"{mark} {self.reference:13} {hip} lateral {100 * self.lateral:4.0f} heading {heading} "
            f"deep {100 * self.penetration:4.1f} {self.cpu_seconds:4.1f} s{turn}"
        )

    def caption(self) -> str:
        """For the contact sheet."""
        return f"{self.object[:44]}  {self.line()}"


def load_synthesizer(plan: Plan) -> Synthesizer:
    """With the plan's weights and terms."""
    settings = SynthesizerSettings(weights=plan.weights) if plan.weights else SynthesizerSettings()
    made = Synthesizer.load(settings)
    made.config = replace(made.config, weights=ablated(made.config, plan.terms))
    return made


def ablated(config: SolverConfig, terms: str) -> EnergyWeights:
    """All terms, the paper's without geometry, or geometry without descriptors."""
    if terms == "descriptor":
        return replace(
            config.weights, contact=0.0, clearance=0.0, symmetry=0.0, penetration=0.0, self_collision=0.0, gravity=0.0
        )
    return replace(config.weights, descriptor=0.0) if terms == "geometry" else config.weights


def evaluate_object(synthesizer: Synthesizer, item: EvaluationObject, plan: Plan) -> list[Run]:
    """A run per initial heading; the first also on turned uploads and with a picture. Unreadable files give no runs."""
    data = item.path.read_bytes()
    try:
        shape = load_shape(data, format_of(item.path.name))
    except ObjectError as error:
        print(f"{item.name}: {error}")
        return []
    region = seat_region(*shape.mesh, seat_height=item.seat_height) if shape.mesh else None
    runs = []
    for k, yaw in enumerate(plan.headings):
        request = GoalPoseRequest(reference=plan.reference, action=plan.action, initial_yaw=yaw, solver=plan.solver)
        began = time.thread_time()
        result = synthesizer.synthesize(shape, request)
        run = judge(item, region, shape, result, yaw, synthesizer, cpu=time.thread_time() - began)
        if k == 0:
            errors = [_turn_error(synthesizer, shape, request, result, seed) for seed in range(plan.turned)]
            picture = draw(shape, result) if plan.pictures else None
            run = replace(run, turn_error=max(errors) if errors else None, picture=picture)
        runs.append(run)
    return runs


def judge(
    item: EvaluationObject,
    region: SeatRegion | None,
    shape: Shape,
    result: GoalPoseResult,
    yaw: float,
    synthesizer: Synthesizer,
    *,
    cpu: float,
) -> Run:
    """Measures of one result."""
    hip = result.pose.positions()[0]
    pair = synthesizer.references[result.reference]
    reference_height = next(m.hip_height for (name, _, _), m in synthesizer._models.items() if name == pair.id)
    middle = float(shape.bounds[:, 0].mean())
    front = None
    if region is not None and region.has_back and item.category not in ("stool", "barstool"):
        front = abs(math.remainder(result.pose.yaw(), 2 * math.pi))
    return Run(
        object=item.name,
        category=item.category,
        subtype=item.subtype,
        initial_yaw=yaw,
        reference=result.reference,
        hip_distance=None if region is None else region.distance(hip, reference_height),
        lateral=abs(float(hip[0]) - middle) if item.category in ONE_SEAT else 0.0,
        heading_error=front,
        penetration=result.diagnostics["penetration_depth"],
        floor=result.diagnostics.get("floor_distance"),
        seconds=result.seconds,
        cpu_seconds=cpu,
        turn_error=None,
        warnings=tuple(w.reason for w in result.warnings),
        diagnostics=result.diagnostics,
        energies=result.energies,
    )


def _turn_error(
    synthesizer: Synthesizer, shape: Shape, request: GoalPoseRequest, result: GoalPoseResult, seed: int
) -> float:
    """Largest joint distance [m] between the pose on the turned and moved upload and the turned and moved pose."""
    assert shape.mesh is not None
    random = np.random.default_rng(seed)
    yaw, offset = random.uniform(-math.pi, math.pi), random.uniform(-3.0, 3.0, 3)
    turn = quat_from_yaw(np.array(yaw))
    vertices = quat_rotate(np.broadcast_to(turn, (len(shape.mesh[0]), 4)), shape.mesh[0].astype(np.float64)) + offset
    file = io.BytesIO()
    trimesh.Trimesh(vertices, shape.mesh[1], process=False).export(file, file_type="ply")
    turned = synthesizer.synthesize(load_shape(file.getvalue(), "ply", unit="m", up="y"), request)
    expected = result.pose.turned(yaw).positions() + offset
    return float(np.linalg.norm(turned.pose.positions() - expected, axis=-1).max())


def draw(shape: Shape, result: GoalPoseResult) -> Pixels:
    """Three views of the object with the body."""
    scene = object_splats(*shape.mesh) if shape.mesh is not None else cloud_splats(shape.points, shape.normals)
    body = body_splats(result.pose)
    return scene_views([scene, mark_deep(body, shape.distance.sample(body.points))])


__all__ = ["DEFAULT", "Plan", "Run", "evaluate_object", "load_synthesizer"]
