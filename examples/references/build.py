"""Makes the reference pairs of this folder: python examples/references/build.py

Every pair is one authored pose of the humanoid skeleton on one reference object, in the object's canonical space: +Y
up, seat facing +Z, floor at y = 0. Two files: NAME.json (pose and description) and NAME.glb (the object).
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh
from posture import LimbGoal, author_pose
from roam_character.clip import Clip
from roam_character.pose import Pose
from roam_character.skeleton import humanoid_skeleton
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.solids import Pillow
from seats import armchair, bar_stool, bed, bench, dining_chair, lounger, office_chair, open_armchair, sofa, stool

FOLDER = Path(__file__).parent
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
# Head to +X, facing up: the body's left lies towards +Z, the open side of a sofa.
SUPINE = np.array([-0.5, -0.5, -0.5, 0.5])
# Height of the hip joints above the seat: the radius of the buttocks less the centimetre or two that flesh gives.
BUTTOCK = 0.088
# The humanoid's hips joint is this far above its hip joints.
PELVIS = 0.06
ANKLE = 0.0805


@dataclass(frozen=True)
class Pair:
    """What one reference file holds."""

    id: str
    title: str
    action: str
    categories: tuple[str, ...]
    pose: Pose
    furniture: Furniture


def sitting(
    *,
    seat: float,
    hip_z: float,
    lean: float,
    upright: float,
    knee: float,
    spread: float,
    wrists: LimbGoal,
    ankle: float = ANKLE,
    hip_above: float = BUTTOCK,
) -> Pose:
    """A person on a seat of height `seat` [m], pelvis leaning back by `lean` degrees, the trunk coming up by `upright`.

    `hip_z` is where the hip joints are, `knee` how far the ankles are in front of them, `spread` half the feet's
    distance.
    """
    tilt = np.radians(lean)
    root = (0.0, seat + hip_above + PELVIS * np.cos(tilt), hip_z - PELVIS * np.sin(tilt))
    step = upright / 3
    level = lean - upright  # what is left for the neck to bring the eyes to the horizon
    pitches = {
        "hips": -lean,
        "spine": step,
        "chest": step,
        "upperChest": step,
        "neck": 0.75 * level,
        "head": 0.15 * level,
    }
    legs = LimbGoal(end=(spread, ankle, hip_z + knee), pole=(0.05, 0.5, 1.0), direction=(0.13, 0.0, 1.0))
    return author_pose(humanoid_skeleton(), root=root, facing=UPRIGHT, pitches=pitches, arms=wrists, legs=legs)


def hands_on_thighs(seat: float, hip_z: float, *, along: float = 0.20, out: float = 0.125) -> LimbGoal:
    """Wrists above the thighs, `along` [m] in front of the hip joints, fingers forward and a little inward."""
    return LimbGoal(
        end=(out, seat + 0.178, hip_z + along),
        pole=(0.55, -0.2, -1.0),
        direction=(-0.22, -0.20, 1.0),
        normal=(0.25, 1.0, 0.1),
    )


def arms_on_rests(rest: float, half: float, hip_z: float, *, along: float = 0.19) -> LimbGoal:
    """Forearms on armrests of height `rest` [m] at x = +-`half` [m]."""
    return LimbGoal(
        end=(half, rest + 0.036, hip_z + along),
        pole=(0.5, -0.6, -1.0),
        direction=(-0.12, -0.06, 1.0),
        normal=(0.1, 1.0, 0.05),
    )


def chair_sit() -> Pair:
    pose = sitting(
        seat=0.45, hip_z=-0.115, lean=15, upright=6, knee=0.30, spread=0.125, wrists=hands_on_thighs(0.45, -0.115)
    )
    return Pair(
        "chair_sit",
        "Sitting on a dining chair, hands on the thighs",
        "sit",
        ("chair",),
        pose,
        dining_chair(seat=0.45, foot=-0.207, lean=12.5),
    )


def chair_arms() -> Pair:
    pose = sitting(
        seat=0.45, hip_z=-0.105, lean=17, upright=6, knee=0.30, spread=0.13, wrists=arms_on_rests(0.655, 0.265, -0.105)
    )
    furniture = open_armchair(seat=0.45, foot=-0.2, lean=14, arm_half=0.265, arm_height=0.655)
    return Pair(
        "armchair_sit", "Sitting in a wooden armchair, forearms on the rests", "sit", ("armchair",), pose, furniture
    )


def sofa_sit() -> Pair:
    pose = sitting(
        seat=0.41,
        hip_z=-0.16,
        lean=26,
        upright=9,
        knee=0.475,
        spread=0.15,
        wrists=hands_on_thighs(0.41, -0.16, along=0.17, out=0.14),
    )
    furniture = sofa(seat=0.41, foot=-0.262, lean=20, half_width=0.95, arm=0.18, arm_height=0.60, front=0.23)
    return Pair("sofa_sit", "Sitting in the middle of a sofa, leaning back", "sit", ("sofa",), pose, furniture)


def lounge_sit() -> Pair:
    pose = sitting(
        seat=0.40,
        hip_z=-0.14,
        lean=26,
        upright=8,
        knee=0.50,
        spread=0.14,
        wrists=arms_on_rests(0.585, 0.325, -0.14, along=0.17),
    )
    furniture = armchair(seat=0.40, foot=-0.242, lean=20, inner=0.265, arm=0.15, arm_height=0.585, front=0.265)
    return Pair(
        "lounge_sit", "Sitting in an upholstered armchair, arms on the rests", "sit", ("armchair",), pose, furniture
    )


def office_sit() -> Pair:
    pose = sitting(
        seat=0.46, hip_z=-0.115, lean=15, upright=7, knee=0.31, spread=0.14, wrists=arms_on_rests(0.67, 0.30, -0.115)
    )
    furniture = office_chair(seat=0.46, foot=-0.21, lean=12.5, arm_height=0.67)
    return Pair(
        "office_sit", "Sitting on an office chair, forearms on the rests", "sit", ("officechair",), pose, furniture
    )


def stool_sit() -> Pair:
    pose = sitting(
        seat=0.45,
        hip_z=-0.03,
        lean=2,
        upright=4,
        knee=0.28,
        spread=0.13,
        wrists=hands_on_thighs(0.45, -0.03, along=0.24),
    )
    return Pair("stool_sit", "Sitting upright on a stool", "sit", ("stool",), pose, stool(seat=0.45, half=0.18))


def bench_sit() -> Pair:
    pose = sitting(
        seat=0.45,
        hip_z=-0.03,
        lean=3,
        upright=4,
        knee=0.29,
        spread=0.13,
        wrists=hands_on_thighs(0.45, -0.03, along=0.24),
    )
    return Pair(
        "bench_sit",
        "Sitting on a bench without a back",
        "sit",
        ("bench",),
        pose,
        bench(seat=0.45, half_width=0.65, depth=0.34),
    )


def bar_sit() -> Pair:
    seat, ring = 0.72, 0.30
    pose = sitting(
        seat=seat,
        hip_z=-0.02,
        lean=2,
        upright=3,
        knee=0.24,
        spread=0.11,
        ankle=ring + 0.075,
        hip_above=0.095,
        wrists=LimbGoal(
            end=(0.125, seat + 0.15, 0.20),
            pole=(0.55, -0.2, -1.0),
            direction=(-0.22, -0.35, 1.0),
            normal=(0.25, 1.0, 0.2),
        ),
    )
    return Pair(
        "bar_sit",
        "Sitting on a bar stool, feet on the ring",
        "sit",
        ("barstool",),
        pose,
        bar_stool(seat=seat, radius=0.18, ring=ring),
    )


def lying(*, top: float, hip_x: float, z: float, raise_trunk: float, raise_head: float, knee_bend: float) -> Pose:
    """A person on the back on a surface of height `top` [m], head towards +X; trunk, head and knees raised by
    degrees."""
    root = (hip_x, top + 0.10, z)
    pitches = {"spine": raise_trunk / 2, "chest": raise_trunk / 2, "neck": raise_head / 2, "head": raise_head / 2}
    flex = np.radians(knee_bend)
    hip_y = top + 0.10
    # The foot rests on its heel: the ankle 5 cm above the surface.
    thigh, shank = 0.40, 0.42
    rise = (hip_y - (top + 0.055)) / thigh
    lift = np.arcsin(min(0.9, (shank * np.sin(flex) - rise * thigh) / thigh)) if knee_bend else -np.arcsin(rise)
    reach = thigh * np.cos(lift) + shank * np.cos(flex) - 0.002
    ankle_x = hip_x - PELVIS - reach
    legs = tuple(
        LimbGoal(
            end=(ankle_x, top + 0.055, z + s * 0.11),
            pole=(0.0, 1.0, s * 0.12),
            direction=(-0.35 * np.cos(flex) - 0.3 * np.sin(flex), 1.0 - 0.7 * np.sin(flex), s * 0.3),
            normal=(1.0, 0.3, 0.0),
        )
        for s in (1, -1)
    )
    arms = tuple(
        LimbGoal(
            end=(hip_x + 0.12, top + 0.235, z + s * 0.13),
            pole=(0.3, -0.6, s * 1.0),
            direction=(-0.75, -0.05, -s * 0.65),
            normal=(0.0, 1.0, 0.15 * s),
        )
        for s in (1, -1)
    )
    return author_pose(
        humanoid_skeleton(), root=root, facing=SUPINE, pitches=pitches, arms=(arms[0], arms[1]), legs=(legs[0], legs[1])
    )


def sofa_lie() -> Pair:
    pose = lying(top=0.41, hip_x=0.05, z=0.08, raise_trunk=10, raise_head=16, knee_bend=32)
    furniture = sofa(seat=0.41, foot=-0.245, lean=14, half_width=1.09, arm=0.18, arm_height=0.58, front=0.36)
    cushion = Pillow(center=np.array([0.74, 0.445, 0.08]), half=np.array([0.15, 0.07, 0.22]))
    furniture = Furniture("sofa", (*furniture.solids, cushion), furniture.seats)
    return Pair(
        "sofa_lie", "Lying on the back on a sofa, head on a cushion, knees bent", "lie", ("sofa",), pose, furniture
    )


def sofa_lie_left() -> Pair:
    """The same with the head at the other end: with the backrest on one side, neither is a turn of the other."""
    right = sofa_lie()
    skeleton = right.pose.skeleton
    clip = Clip(skeleton, 30.0, right.pose.root_position[None], right.pose.rotations[None])
    *rest, cushion = right.furniture.solids
    other_end = replace(cushion, center=cushion.center * np.array([-1.0, 1.0, 1.0]))
    furniture = Furniture("sofa", (*rest, other_end), right.furniture.seats)
    title = "Lying on the back on a sofa, head on a cushion at the left end, knees bent"
    return Pair("sofa_lie_left", title, "lie", ("sofa",), clip.mirrored().pose(0), furniture)


def lounger_lie() -> Pair:
    """Half sitting, half lying: the trunk on a reclined back, the legs up."""
    seat, foot, lean, hip_z = 0.36, -0.20, 50.0, -0.135
    tilt = np.radians(lean)
    root = (0.0, seat + BUTTOCK + PELVIS * np.cos(tilt), hip_z - PELVIS * np.sin(tilt))
    # The neck goes back as far as it takes for the head to rest: on a flat back without a pillow.
    pitches = {"hips": -lean, "spine": 0.5, "chest": 0.5, "upperChest": 0.0, "neck": -6.0, "head": 2.0}
    legs = LimbGoal(
        end=(0.11, seat + 0.055, hip_z + 0.795),
        pole=(0.12, 1.0, 0.1),
        direction=(0.25, 1.0, 0.35),
        normal=(0.0, 0.3, -1.0),
    )
    arms = LimbGoal(
        end=(0.14, seat + 0.22, hip_z + 0.04),
        pole=(0.9, -0.6, -0.3),
        direction=(-0.5, -0.25, 0.8),
        normal=(0.3, 1.0, 0.1),
    )
    pose = author_pose(humanoid_skeleton(), root=root, facing=UPRIGHT, pitches=pitches, arms=arms, legs=legs)
    furniture = lounger(seat=seat, foot=foot, lean=lean, half_width=0.31, front=0.85)
    return Pair(
        "lounger_lie", "Reclining on a lounger, head at its back, legs up", "lie", ("lounger",), pose, furniture
    )


def bed_lie() -> Pair:
    pose = lying(top=0.48, hip_x=0.02, z=0.0, raise_trunk=5, raise_head=12, knee_bend=0)
    return Pair(
        "bed_lie",
        "Lying on the back on a bed",
        "lie",
        ("bed",),
        pose,
        bed(top=0.48, half_width=0.75, length=2.0, pillow=0.07),
    )


PAIRS: tuple[Callable[[], Pair], ...] = (
    chair_sit,
    chair_arms,
    sofa_sit,
    lounge_sit,
    office_sit,
    stool_sit,
    bench_sit,
    bar_sit,
    sofa_lie,
    sofa_lie_left,
    lounger_lie,
    bed_lie,
)


def write(pair: Pair) -> None:
    """NAME.json and NAME.glb."""
    mesh = pair.furniture.to_trimesh()
    (FOLDER / f"{pair.id}.glb").write_bytes(trimesh.Scene(mesh).export(file_type="glb"))
    skeleton = pair.pose.skeleton
    record = {
        "id": pair.id,
        "title": pair.title,
        "action": pair.action,
        "categories": list(pair.categories),
        "object": f"{pair.id}.glb",
        "skeleton": skeleton.name,
        "root_position": [round(float(x), 5) for x in pair.pose.root_position],
        "rotations": {
            name: [round(float(x), 6) for x in q]
            for name, q in zip(skeleton.joint_names, pair.pose.rotations, strict=True)
        },
    }
    (FOLDER / f"{pair.id}.json").write_text(json.dumps(record, indent=1) + "\n")


def main() -> None:
    for make in PAIRS:
        pair = make()
        write(pair)
        print(
            pair.id,
            "hips joint above the seat [m]:",
            round(float(pair.pose.root_position[1]) - pair.furniture.seat_height, 3),
        )


if __name__ == "__main__":
    main()
