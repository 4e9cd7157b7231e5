"""How good a goal pose is, in metres, and why it is doubtful if it is."""

from dataclasses import dataclass

import torch

from goalpose.candidates import facing_yaw
from goalpose.energy.angle_limit import swing_twist
from goalpose.energy.contact import LEAN, SUPPORT
from goalpose.energy.figure import Figure
from goalpose.energy.penetration import penetration_depths
from goalpose.energy.prior import canonical_positions
from goalpose.energy.total import ReferenceModel, Target
from goalpose.reference_model import height_above_surface

MET = 0.03  # [m] a contact closer than this is met
DEEP = 0.05  # [m]
OFF_FLOOR = 0.05  # [m]
LOWEST_SEAT = 0.20  # [m] over the floor; lower ones are steps
LYING = 0.25  # [m] that the neck is over the hips at most of whoever lies
WIDEST_PERCH = 0.30  # [m^2] what is larger, as high that legs dangle and without a back is a table
_CELL, _REACH, _SAG, _SLAT = 0.05, 0.50, 0.08, 0.03  # [m] of the grid that looks for the seat around the hips


@dataclass(frozen=True)
class PoseWarning:
    """Why a pose is doubtful."""

    reason: str  # NO_PLAUSIBLE_POSE, DEEP_PENETRATION or FEET_OFF_FLOOR
    message: str
    remedy: str


def diagnose(figure: Figure, model: ReferenceModel, target: Target) -> dict[str, float]:
    """Measures of the first pose of a batch, in metres, radians and shares.

    `hip_height`: hips joint above the surface below it; `hip_seat_distance`: its difference from the reference's;
    `penetration_depth`: of the deepest capsule; `floor_distance`: of the worse sole from the floor (only when the
    reference stands on it); `floor_reach`: how high the feet hang over the floor where the seat is higher than the
    reference's and nothing else changes; `seat_height` over the floor, and `seat_area` [m^2] that is
    level with it in a metre's square about the hips; `heading`; `contacts_met`: weighted share; `support_miss`,
    `lean_miss`: median distance of the body from what holds it from below and from behind; `trunk_rise`: height of the
    neck over the hips; `pose_change`: mean joint distance from the reference's canonical pose; `limit_excess`: the
    joint angle furthest outside its bounds.
    """
    with torch.no_grad():
        hip_height = support_height(figure, target)
        contacts = model.contacts
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
            "pose_change": float((canonical_positions(figure)[0] - model.canonical[0]).norm(dim=-1).mean()),
            "limit_excess": _limit_excess(figure, model),
        }
        joints = figure.positions[0, figure.skeleton.indices(["hips", "neck"]), 1]
        values["trunk_rise"] = float(joints[1] - joints[0])
        values |= _seat(figure, target, float(figure.root_position[0, 1]) - hip_height)
        leaning = contacts.group[0] == LEAN
        if leaning.any():
            values["lean_miss"] = float(misses[leaning].median())
        if on_floor.any():
            values["floor_distance"] = float(misses[on_floor].max())
            values["floor_reach"] = _floor_reach(figure, model, target)
    return values


def _seat(figure: Figure, target: Target, top: float) -> dict[str, float]:
    """The surface that holds the first pose, whose `top` [m] lies below the hips: how high and how large."""
    steps = torch.arange(-_REACH, _REACH + 0.5 * _CELL, _CELL)
    drops = torch.arange(_SAG, -_SAG - 0.01, -0.02)
    x, y, z = torch.meshgrid(steps, drops, steps, indexing="ij")
    hips = figure.root_position[0]
    column = torch.stack([hips[0] + x, top + y, hips[2] + z], dim=-1)
    level = (target.distance.query(column) <= _SLAT).any(1)  # slats and strings with gaps between them too
    return {"seat_height": top - target.floor_height, "seat_area": float(level.sum()) * _CELL**2}


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


def _limit_excess(figure: Figure, model: ReferenceModel) -> float:
    limits = model.limits
    angles = swing_twist(figure.rotations[:1, limits.joint], limits.axis)
    return float(torch.maximum(angles - limits.high, limits.low - angles).clamp(min=0.0).max())


def _implausible(values: dict[str, float]) -> bool:
    """Not held from below, hips off the surface, through the object, on a step, or on a table with dangling legs and no
    back behind."""
    least = 0.6 if values["trunk_rise"] < LYING else 0.25  # who lies needs all of the bed: a back rest's top is none
    held = values["support_miss"] < 0.06 and values["contacts_met"] > least and values["hip_seat_distance"] < 0.12
    dangling = values.get("floor_distance", 0.0) > 0.2 and values.get("lean_miss", 1.0) > 0.06
    on_table = dangling and values["seat_area"] > WIDEST_PERCH
    on_step = "floor_distance" in values and values["seat_height"] < LOWEST_SEAT
    return not held or on_table or on_step or values["penetration_depth"] > 0.1


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
    return tuple(found)
