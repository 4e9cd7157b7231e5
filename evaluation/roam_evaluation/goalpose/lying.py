"""One lying pose, judged against the furniture as it is: held, free, along it, and with the head at the right end."""

import math
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt
from roam_character.body import body_capsules
from roam_character.pose import Pose
from roam_character.skeleton import humanoid_skeleton
from roam_goalpose.energy.body import body_points
from roam_goalpose.objects import Shape
from roam_goalpose.synthesis import GoalPoseResult

from roam_evaluation.goalpose.inputs.objects import EvaluationObject
from roam_evaluation.goalpose.runs import bone_depths, figure_of_pose, rounded

Array = npt.NDArray[np.floating]

GAP, DEPTH, ALONG = 0.05, 0.03, math.radians(20)
OFF_SEAT = 0.15  # [m] cushions and pillows are less over the seat
HELD = ("hips", "chest", "head")  # bones that must lie on something
REACH = 0.6  # [m] how far below and behind the body a surface is looked for
LONG = 1.2  # times as long as wide: then there is a way along the furniture
FRONT = 0.3  # length of `Shape.front` from which front and back differ
REFUSED = "NO_PLAUSIBLE_POSE"


@dataclass(frozen=True)
class LyingRun:
    """One pose, judged. Everything in it can be written as JSON."""

    object: str
    category: str
    subtype: str
    reference: str
    gaps: dict[str, float]  # [m] between HELD and what is below or behind them
    penetration: float  # [m] of the deepest capsule in the object as it is
    across: (
        float | None
    )  # [rad] between body and the way from the head board, else the long side; None: as long as wide
    head_at_back: bool | None  # of beds and loungers: at the head board; None: any end is as good
    off_seat: float  # [m] between what holds the hips and the seat or mattress; on top of a back rest it is much
    head_room: float  # [m] from the top of the head to the furniture's end there, along it; below 0: over the end
    foot_room: float  # [m] the same of the toes
    rise: float  # [m] of the neck over the hips
    length: float  # [m] of the furniture's longer side
    cpu_seconds: float
    warnings: tuple[str, ...]
    diagnostics: dict[str, float]
    root_position: list[float]  # [3] [m], on the canonical object
    rotations: list[list[float]]  # [J, 4]

    @property
    def held(self) -> bool:
        """Pelvis, back and head within 5 cm of what is below them."""
        return max(self.gaps.values()) <= GAP

    @property
    def success(self) -> bool:
        """Held by seat or mattress, nothing deeper than 3 cm, along the furniture, the head at the head board."""
        along = self.across is None or self.across <= ALONG
        there = self.held and self.off_seat <= OFF_SEAT
        return there and self.penetration <= DEPTH and along and self.head_at_back is not False

    @property
    def refused(self) -> bool:
        """Whether the answer itself says that nobody can lie so."""
        return REFUSED in self.warnings

    @property
    def pose(self) -> Pose:
        """The pose, on the canonical object."""
        return Pose(humanoid_skeleton(), np.array(self.root_position, np.float32), np.array(self.rotations, np.float32))

    def record(self) -> dict[str, Any]:
        """For JSON."""
        values: dict[str, Any] = rounded(asdict(self))
        return values | {"held": self.held, "success": self.success, "refused": self.refused}

    def line(self) -> str:
        """For the terminal."""
        gaps = " ".join(f"{bone} {100 * gap:.0f}" for bone, gap in self.gaps.items())
        across = "-" if self.across is None else f"{math.degrees(self.across):.0f}"
        head = {None: "", True: " head right", False: " HEAD WRONG"}[self.head_at_back]
        mark = "GOOD" if self.success else "told" if self.refused else "BAD "
        rooms = f"room cm head {100 * self.head_room:.0f} feet {100 * self.foot_room:.0f}"
        deep = f"deep {100 * self.penetration:.1f}"
        return f"{mark} {self.reference} gaps cm {gaps}, {deep}, {rooms}, across {across}{head}"


def lying_run_from(record: dict[str, Any]) -> LyingRun:
    """A run from its record."""
    return LyingRun(**{field.name: record[field.name] for field in fields(LyingRun)})


def judge_lying(item: EvaluationObject, truth: Shape, result: GoalPoseResult, *, cpu_seconds: float) -> LyingRun:
    """Measures of one answer on a canonical object: facing +Z, so that beds and loungers have their heads at −Z."""
    pose = result.pose
    joints = pose.positions()
    hips, neck = (joints[pose.skeleton.index(name)] for name in ("hips", "neck"))
    sides = np.ptp(truth.bounds, axis=0)
    # Sofas have their backs along the body, and so have day-beds.
    headed = item.category in ("bed", "lounger") and sides[2] > sides[0] / LONG
    boarded = bool(headed and np.linalg.norm(truth.front) > FRONT)
    head_room, foot_room = _rooms(pose, truth, boarded)
    return LyingRun(
        object=item.name,
        category=item.category,
        subtype=item.subtype,
        reference=result.reference,
        gaps=support_gaps(pose, truth),
        penetration=max(bone_depths(pose, truth).values(), default=0.0),
        across=_across(neck - hips, sides, boarded),
        head_at_back=bool(neck[2] < hips[2]) if boarded else None,
        off_seat=abs(result.diagnostics["seat_height"] - (item.seat_height or result.diagnostics["seat_height"])),
        head_room=head_room,
        foot_room=foot_room,
        rise=float(neck[1] - hips[1]),
        length=float(max(sides[0], sides[2])),
        cpu_seconds=cpu_seconds,
        warnings=tuple(warning.reason for warning in result.warnings),
        diagnostics=result.diagnostics,
        root_position=pose.root_position.tolist(),
        rotations=pose.rotations.tolist(),
    )


def _rooms(pose: Pose, shape: Shape, boarded: bool) -> tuple[float, float]:
    """What is left between the head's capsule, the toes and the two ends of the furniture's box [m]."""
    sides = np.ptp(shape.bounds, axis=0)
    axis = 2 if boarded or sides[2] > sides[0] else 0
    middle = float(shape.bounds[:, axis].mean())
    capsules = body_capsules(pose.skeleton)
    head = [c for c, name in enumerate(capsules.names) if name == "head"]
    ends = np.concatenate([part[head][:, axis] for part in capsules.segments(*pose.posture())]) - middle
    radius = float(capsules.radii[head].max())
    joints = pose.positions()[:, axis] - middle
    feet = np.array([joints[pose.skeleton.index(f"{side}Toes")] for side in ("left", "right")])
    towards = 1.0 if ends.mean() > feet.mean() else -1.0
    half = 0.5 * float(sides[axis])
    return half - float((towards * ends).max()) - radius, half - float((-towards * feet).max())


def support_gaps(pose: Pose, shape: Shape) -> dict[str, float]:
    """What is between the bones HELD and the first surface straight below or behind them [m], at least 0.

    Behind, because a reclined trunk leans: what is straight below it lies under the back rest's slope.
    """
    capsules = body_capsules(pose.skeleton)
    body = body_points(capsules)
    figure = figure_of_pose(pose)
    centres = body.on(figure)[0].numpy()
    backs = -figure.axes[0, body.joint, :, 2].numpy()
    gaps = dict.fromkeys(HELD, REACH)
    for row, capsule in enumerate(body.capsule.tolist()):
        if (name := capsules.names[capsule]) in gaps:
            ways = [_way(shape, centres[row], side) for side in (np.array([0.0, -1.0, 0.0]), backs[row])]
            gaps[name] = min(gaps[name], max(0.0, min(ways) - float(body.radius[row])))
    return gaps


def _way(shape: Shape, start: Array, direction: Array) -> float:
    """From a point `[3]` along a unit direction `[3]` to the object [m]; `REACH` when it is farther."""
    steps = np.arange(0.0, REACH, 0.004)
    met = np.flatnonzero(shape.distance.sample(start + steps[:, None] * direction) <= 0)
    return float(steps[met[0]]) if len(met) else REACH


def _across(trunk: Array, sides: Array, boarded: bool) -> float | None:
    """Angle [rad] between the trunk, seen from above, and the way from the head board or the longer side of the box."""
    x, z = abs(float(trunk[0])), abs(float(trunk[2]))
    if not boarded and max(sides[0], sides[2]) < LONG * min(sides[0], sides[2]):
        return None
    return math.atan2(x, z) if boarded or sides[2] > sides[0] else math.atan2(z, x)
