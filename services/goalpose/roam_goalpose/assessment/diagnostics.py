"""How good a goal pose is, in metres, and why it is doubtful if it is."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch

from roam_goalpose.assessment.support import seat_measures
from roam_goalpose.energy.body import penetration_depths
from roam_goalpose.energy.figure import Figure
from roam_goalpose.energy.reference import ReferenceModel
from roam_goalpose.energy.scene import Target
from roam_goalpose.energy.terms.angle_limit import load_limits, swing_twist
from roam_goalpose.energy.terms.contact import LEAN, SUPPORT, contacts_of
from roam_goalpose.energy.terms.prior import canonical_positions
from roam_goalpose.references.model import height_above_surface
from roam_goalpose.solvers.candidates import facing_yaw

MET = 0.03  # [m] a contact closer than this is met
DEEP = 0.05  # [m]
OFF_FLOOR = 0.05  # [m]
LOWEST_SEAT = 0.20  # [m] over the floor; lower ones are steps
LYING = 0.25  # [m] that the neck is over the hips at most of whoever lies
WIDEST_PERCH = 0.30  # [m^2] what is larger, as high that legs dangle and without a back is a table


NO_SEAT, NARROW = 0.10, 0.18  # [m] across: a rail or an edge holds nobody up, a beam is for perching
NO_BED = 0.45  # [m] across: nobody lies on the top of a back rest, or across a chair
TABLE_LIKE_FILE = Path(__file__).with_name("table_like.json")  # written by roam_goalpose.training.table_like
ROLLS = 0.20  # [m] across what touches the floor: a ball, a log, a single post


@dataclass(frozen=True, kw_only=True)
class TableLike:
    """When a level top without a back may be a table's; deep benches have one too, and nothing tells them apart."""

    broad: float  # [m] across: what is as wide is a table's top, or a bed's
    long: float  # [m] what is as long is a table's if it is also ...
    deep: float  # [m] ... deeper than most benches, ...
    low: float  # [m] ... or low ...
    low_depth: float  # [m] ... and not narrow

    @staticmethod
    @cache
    def load() -> "TableLike":
        """The shipped limits."""
        return TableLike(**json.loads(TABLE_LIKE_FILE.read_text()))

    def holds(self, values: dict[str, float]) -> bool:
        """Of a seat with these diagnostics."""
        breadth = values["seat_breadth"]
        low = values["seat_height"] < self.low and breadth > self.low_depth
        return breadth > self.broad or (values["seat_length"] > self.long and (breadth > self.deep or low))


@dataclass(frozen=True)
class PoseWarning:
    """Why a pose is doubtful."""

    reason: str  # NO_PLAUSIBLE_POSE, DEEP_PENETRATION, FEET_OFF_FLOOR, NARROW_SEAT, UNSTEADY_SEAT, TABLE_LIKE_SEAT
    message: str
    remedy: str


def diagnose(figure: Figure, model: ReferenceModel, target: Target) -> dict[str, float]:
    """Measures of the first pose of a batch, in metres, radians and shares.

    `hip_height`: hips joint above the surface below it; `hip_seat_distance`: its difference from the reference's;
    `penetration_depth`: of the deepest capsule; `floor_distance`: of the worse sole from the floor (only when the
    reference stands on it); `floor_reach`: how high the feet hang over the floor where the seat is higher than the
    reference's and nothing else changes; `seat_height`, `seat_area`, `seat_breadth`, `seat_length`, `base_breadth`:
    see `support`; `heading`; `contacts_met`: weighted share; `support_miss`,
    `lean_miss`: median distance of the body from what holds it from below and from behind; `trunk_rise`: height of the
    neck over the hips; `pose_change`: mean joint distance from the reference's canonical pose; `limit_excess`: the
    joint angle furthest outside its bounds.
    """
    with torch.no_grad():
        hip_height = support_height(figure, target)
        contacts = contacts_of(model)
        points = contacts.on(figure)
        misses = contacts.misses(points[..., 1] - target.floor_height, target.distance.query(points))[0].abs()
        weight, on_floor = contacts.weight[0], contacts.on_floor[0]
        values = {
            "hip_height": hip_height,
            "hip_seat_distance": abs(hip_height - float(model.hip_height)),
            "penetration_depth": float(penetration_depths(figure, model.body, target.distance).max()),
            "heading": float(facing_yaw(figure)[0]),
            "contacts_met": float((weight * (misses < MET)).sum() / weight.sum()),
            "support_miss": float(misses[contacts.group[0] == SUPPORT].median()),
            "pose_change": _pose_change(figure, model),
            "limit_excess": _limit_excess(figure, model),
        }
        joints = figure.positions[0, figure.skeleton.indices(["hips", "neck"]), 1]
        values["trunk_rise"] = float(joints[1] - joints[0])
        values |= seat_measures(figure, target, float(figure.root_position[0, 1]) - hip_height)
        leaning = contacts.group[0] == LEAN
        if leaning.any():
            values["lean_miss"] = float(misses[leaning].median())
        if on_floor.any():
            values["floor_distance"] = float(misses[on_floor].max())
            values["floor_reach"] = _floor_reach(figure, model, target)
    return values


def _floor_reach(figure: Figure, model: ReferenceModel, target: Target) -> float:
    """How much higher over the floor [m] than the reference's the hips are: so high its feet would hang."""
    before = float(model.figure.root_position[0, 1] - model.floor_height)
    return max(0.0, float(figure.root_position[0, 1]) - target.floor_height - before)


def bone_depths(figure: Figure, model: ReferenceModel, target: Target) -> dict[str, float]:
    """How deep the capsules of each bone of the first pose lie in the object [m]; only bones that are in it."""
    depths = penetration_depths(figure[:1], model.body, target.distance)[0]
    found: dict[str, float] = {}
    for joint, depth in zip(model.body.joint.tolist(), depths.tolist(), strict=True):
        if depth > 0:
            bone = model.skeleton.humanoid_bones[joint]
            found[bone] = max(depth, found.get(bone, 0.0))
    return found


def support_height(figure: Figure, target: Target) -> float:
    """Height [m] of the hips joint above the highest surface under hips and hip joints."""
    joints = figure.skeleton.indices(["hips", "leftUpperLeg", "rightUpperLeg"])
    hips = figure.positions[0, joints[0]]
    columns = [torch.stack([figure.positions[0, j, 0], hips[1], figure.positions[0, j, 2]]) for j in joints]
    return min(height_above_surface(target.distance, column) for column in columns)


def _pose_change(figure: Figure, model: ReferenceModel) -> float:
    apart = canonical_positions(figure)[0] - canonical_positions(model.figure)[0]
    return float(apart.norm(dim=-1).mean())


def _limit_excess(figure: Figure, model: ReferenceModel) -> float:
    limits = load_limits(model.skeleton)
    angles = swing_twist(figure.rotations[:1, limits.joint], limits.axis)
    return float(torch.maximum(angles - limits.high, limits.low - angles).clamp(min=0.0).max())


def _implausible(values: dict[str, float]) -> bool:
    """Not held from below, hips off the surface, through the object, on a step, on an edge, or on a table with dangling
    legs and no back behind."""
    least = 0.6 if not sits(values) else 0.25  # who lies needs all of the bed: a back rest's top is none
    held = values["support_miss"] < 0.06 and values["contacts_met"] > least and values["hip_seat_distance"] < 0.12
    dangling = values.get("floor_distance", 0.0) > 0.2 and values.get("lean_miss", 1.0) > 0.06
    on_table = dangling and values["seat_area"] > WIDEST_PERCH
    on_step = "floor_distance" in values and values["seat_height"] < LOWEST_SEAT
    on_edge = values["seat_breadth"] < (NO_SEAT if sits(values) else NO_BED)
    return not held or on_table or on_step or on_edge or values["penetration_depth"] > 0.1


def sits(values: dict[str, float]) -> bool:
    """Whether these are the diagnostics of a trunk that is upright, and held by a seat rather than a bed."""
    return values["trunk_rise"] >= LYING


def _poor_seat(values: dict[str, float]) -> list[PoseWarning]:
    """What is wrong with a seat that holds a body all the same."""
    found = []
    breadth, base = values["seat_breadth"], values["base_breadth"]
    if breadth < NARROW:
        message = f"What holds the hips is only {100 * breadth:.0f} cm across: people perch on it."
        found.append(PoseWarning("NARROW_SEAT", message, "Check the object's unit, or choose something wider."))
    if base < ROLLS:
        message = (
            f"The object touches the floor with {100 * base:.0f} cm only: it may roll or tip over with its sitter."
        )
        found.append(PoseWarning("UNSTEADY_SEAT", message, "Fine if it is fixed in its place."))
    if TableLike.load().holds(values) and values.get("lean_miss", 1.0) > 0.06:
        size = f"at least {100 * breadth:.0f} by {100 * values['seat_length']:.0f} cm"
        message = f"The person sits without a back rest on a level top of {size}, as of a table."
        found.append(PoseWarning("TABLE_LIKE_SEAT", message, "Fine for deep benches, beds, daybeds and large stools."))
    return found


def warn(values: dict[str, float]) -> tuple[PoseWarning, ...]:
    """What a caller should know of these diagnostics."""
    found = []
    if _implausible(values):
        found.append(
            PoseWarning(
                "NO_PLAUSIBLE_POSE",
                "The object does not hold a body: no seat is wide, low and free enough.",
                "Check that it is furniture to sit or lie on, its size, unit and up axis, or choose another reference.",
            )
        )
    if values["penetration_depth"] > DEEP:
        found.append(
            PoseWarning(
                "DEEP_PENETRATION",
                f"A part of the body lies {100 * values['penetration_depth']:.0f} cm deep in the object.",
                "Try another reference pose or more restarts; narrow seats may not fit this skeleton.",
            )
        )
    if values.get("floor_distance", 0.0) > OFF_FLOOR:
        found.append(
            PoseWarning(
                "FEET_OFF_FLOOR",
                f"A foot is {100 * values['floor_distance']:.0f} cm from the floor.",
                "Expected on high seats; otherwise check the object's unit.",
            )
        )
    if sits(values) and not _implausible(values):
        found += _poor_seat(values)
    return tuple(found)
