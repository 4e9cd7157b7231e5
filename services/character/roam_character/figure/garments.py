"""The pieces that the figure is made of, each a closed surface with one colour: skin, hair, clothes, shoes.

Clothes are the body grown by a few millimetres and cut where they end, so hems and sleeves have real edges.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from roam_character.figure import anatomy
from roam_character.figure.modelling import Stance
from roam_character.figure.solids import (
    Solid,
    blend,
    capsule,
    common,
    ellipsoid,
    half_space,
    mirrored,
    seen_from_front,
    sweep,
    thicker,
)


@dataclass(frozen=True)
class Material:
    """How a piece looks: sRGB colour in 0..1, roughness of its surface in 0..1."""

    name: str
    colour: tuple[float, float, float]
    roughness: float


@dataclass(frozen=True, eq=False)
class Piece:
    """A surface in the modelling stance, the box that it lies in, and how finely it is to be cut [m]."""

    material: Material
    solid: Solid
    low: Sequence[float] | np.ndarray
    high: Sequence[float] | np.ndarray
    spacing: float
    triangles: int  # kept by decimation


SKIN = Material("skin", (0.82, 0.60, 0.47), 0.62)
LIPS = Material("lips", (0.70, 0.45, 0.38), 0.55)
HAIR = Material("hair", (0.20, 0.13, 0.09), 0.75)
WHITE = Material("eyes", (0.93, 0.92, 0.90), 0.25)
IRIS = Material("irises", (0.16, 0.11, 0.08), 0.2)
SHIRT = Material("shirt", (0.22, 0.46, 0.60), 0.9)
TROUSERS = Material("trousers", (0.20, 0.24, 0.32), 0.92)
SHOES = Material("shoes", (0.36, 0.22, 0.14), 0.55)
SOLES = Material("soles", (0.88, 0.86, 0.82), 0.8)


def pieces(stance: Stance) -> list[Piece]:
    """Everything, in the stance."""
    return [
        *_skin(stance), *_face(), _hair(), _shirt(stance), _trousers(stance), *_shoes(stance),
    ]  # fmt: skip


def _sides(stance: Stance, bone: str, solid: Solid) -> list[Solid]:
    """A left solid and its mirror image, carried by the left and the right bone."""
    return [stance.carried(f"left{bone}", solid), stance.carried(f"right{bone}", mirrored(solid))]


def _arm_box(stance: Stance, side: str) -> tuple[np.ndarray, np.ndarray]:
    skeleton = stance.skeleton
    joints = [skeleton.humanoid_bones.index(f"{side}{bone}") for bone in ("LowerArm", "Hand")]
    tip = next(t for t in skeleton.tips if t.parent == joints[1])
    end = stance.places[joints[1]] + stance.turns[joints[1]] @ np.array(tip.offset)
    points = np.stack([*stance.places[joints], end])
    return points.min(axis=0) - 0.075, points.max(axis=0) + 0.075


def _skin(stance: Stance) -> list[Piece]:
    face = blend([anatomy.head(), anatomy.neck()], 0.03)
    below = half_space((0, 1.372, 0), (0, -1, 0.2))
    found = [Piece(SKIN, common(face, below), (-0.11, 1.345, -0.13), (0.11, 1.71, 0.14), 0.0026, 9000)]
    sleeve = half_space((0.335, 0, 0), (-1, 0, 0))
    for index, side in enumerate(("left", "right")):
        arm = [
            _sides(stance, "UpperArm", common(anatomy.upper_arm(), sleeve))[index],
            _sides(stance, "LowerArm", anatomy.forearm())[index],
            _sides(stance, "Hand", anatomy.hand())[index],
        ]
        found.append(Piece(SKIN, blend(arm, 0.014), *_arm_box(stance, side), 0.0026, 4200))
    return found


def _face() -> list[Piece]:
    head = anatomy.head()
    found = []
    for side in (lambda s: s, mirrored):
        iris = common(thicker(anatomy.eyeball(), 0.0006), ellipsoid((0.0298, 1.5930, 0.0885), (0.0064, 0.0066, 0.008)))
        for material, solid, count in ((WHITE, anatomy.eyeball(), 220), (IRIS, iris, 160)):
            low, high = np.array([0.012, 1.576, 0.058]), np.array([0.049, 1.612, 0.094])
            if side is mirrored:
                low, high = np.array([-high[0], *low[1:]]), np.array([-low[0], *high[1:]])
            found.append(Piece(material, side(solid), low, high, 0.0013, count))
        arch = seen_from_front([(0.0125, 1.6140, 0.0026), (0.0230, 1.6165, 0.0034), (0.0350, 1.6168, 0.0030),
                                (0.0475, 1.6115, 0.0014)], 0.05)  # fmt: skip
        brow = common(thicker(head, 0.0014), arch, radius=0.0008)
        low, high = np.array([0.004, 1.598, 0.060]), np.array([0.056, 1.626, 0.104])
        if side is mirrored:
            low, high = np.array([-high[0], *low[1:]]), np.array([-low[0], *high[1:]])
        found.append(Piece(HAIR, side(brow), low, high, 0.0013, 260))
    lips = blend([anatomy.upper_lip(), anatomy.lower_lip()], 0.0004)
    mouth = common(thicker(head, 0.0006), lips, radius=0.0006)
    found.append(Piece(LIPS, mouth, (-0.026, 1.522, 0.070), (0.026, 1.550, 0.108), 0.0012, 500))
    return found


def _hair() -> Piece:
    cap = ellipsoid((0, 1.612, -0.010), (0.0815, 0.0860, 0.0985))
    crown = ellipsoid((0, 1.640, 0.018), (0.070, 0.055, 0.078))
    nape = ellipsoid((0, 1.565, -0.050), (0.058, 0.055, 0.043))
    whole = blend([cap, crown, nape], 0.03)
    line = sweep([
        (0, 1.500, 0.100, 0.110, 0.050), (0, 1.560, 0.080, 0.110, 0.052), (0, 1.6200, 0.078, 0.085, 0.036),
    ], across=(1, 0, 0))  # fmt: skip
    below = sweep([(0, 1.48, 0.06, 0.12, 0.055), (0, 1.565, 0.015, 0.12, 0.040)])

    def strands(points: np.ndarray) -> np.ndarray:
        around = np.arctan2(points[:, 0], points[:, 2] + 0.03)
        wave = np.sin(26 * around + 60 * points[:, 1]) + 0.6 * np.sin(43 * around - 45 * points[:, 1])
        return np.asarray(whole(points) + 0.0008 * wave)

    kept = common(
        strands, lambda p: -line(p), lambda p: -below(p), half_space((0, 1.560, 0), (0, -1, 0.35)), radius=0.010
    )
    return Piece(HAIR, kept, (-0.11, 1.48, -0.15), (0.11, 1.73, 0.13), 0.0024, 5600)


def _shirt(stance: Stance) -> Piece:
    x, y, z = anatomy.SHOULDER
    sleeve = sweep([
        (x - 0.004, y - 0.004, z, 0.0560, 0.0530),
        (x + 0.070, y - 0.003, z, 0.0560, 0.0560),
        (x + 0.140, y - 0.002, z, 0.0550, 0.0560),
        (x + 0.190, y - 0.002, z, 0.0560, 0.0580),
        (x + 0.215, y - 0.002, z, 0.0560, 0.0580),
    ], across=(0, 0, 1))  # fmt: skip
    sleeve = common(sleeve, half_space((0.352, 0, 0), (1, 0, -0.06)), radius=0.006)
    hem = sweep([(0, 0.89, -0.013, 0.190, 0.140), (0, 0.97, -0.010, 0.178, 0.127), (0, 1.08, 0, 0.144, 0.103)])
    girdle = thicker(anatomy.shoulder_girdle(), 0.007)
    trunk = blend([thicker(anatomy.torso(), 0.008), hem, girdle, mirrored(girdle)], 0.035)
    whole = blend([trunk, *_sides(stance, "UpperArm", sleeve)], 0.035)
    collar = capsule((0, 1.400, -0.030), (0, 1.60, 0.015), 0.0610, 0.080)
    neckline = half_space((0, 1.446, -0.030), (0, 1, 0.50))

    def folded(points: np.ndarray) -> np.ndarray:
        low = np.clip((1.20 - points[:, 1]) / 0.15, 0, 1)
        wave = np.sin(34 * points[:, 1] + 9 * np.abs(points[:, 0]) + 4 * np.sin(17 * points[:, 2]))
        return np.asarray(whole(points) - 0.0018 * low * wave)

    cut = common(folded, half_space((0, 0.922, 0), (0, -1, 0)), neckline, lambda p: -collar(p), radius=0.007)
    return Piece(SHIRT, cut, (-0.46, 0.90, -0.19), (0.46, 1.47, 0.20), 0.0050, 9000)


def _trousers(stance: Stance) -> Piece:
    hips = thicker(anatomy.torso(), 0.006)
    thighs = _sides(stance, "UpperLeg", thicker(anatomy.thigh(), 0.007))
    x, knee, _ = anatomy.KNEE
    tube = sweep([
        (x, knee + 0.015, 0.002, 0.0570, 0.0600),
        (x, knee - 0.080, -0.006, 0.0570, 0.0610),
        (x, knee - 0.180, -0.012, 0.0560, 0.0600),
        (x, knee - 0.300, -0.010, 0.0530, 0.0570),
        (x, 0.060, -0.008, 0.0520, 0.0580),
    ])  # fmt: skip

    def folded(points: np.ndarray) -> np.ndarray:
        low = np.clip((0.24 - points[:, 1]) / 0.12, 0, 1)
        wave = np.sin(95 * points[:, 1] + 14 * points[:, 2] + 2 * np.sin(60 * (points[:, 0] - x)))
        return np.asarray(tube(points) - 0.0028 * low * wave)

    leg = common(folded, half_space((x, 0.074, 0), (0, -1, 0.12)), radius=0.006)
    legs = _sides(stance, "LowerLeg", leg)
    whole = blend([hips, *[blend([a, b], 0.02) for a, b in zip(thighs, legs, strict=True)]], 0.035)
    cut = common(whole, half_space((0, 0.985, 0), (0, 1, 0)))
    return Piece(TROUSERS, cut, (-0.30, 0.02, -0.25), (0.30, 1.0, 0.42), 0.0056, 9000)


def _shoes(stance: Stance) -> list[Piece]:
    ground, edge = anatomy.floor(), half_space((0, 0.0150, 0), (0, -1, 0))
    upper = common(thicker(anatomy.foot(), 0.002), edge, radius=0.003)
    sole = common(thicker(anatomy.foot(), 0.0055), ground, half_space((0, 0.0185, 0), (0, 1, 0)), radius=0.003)
    found = []
    for index, side in enumerate(("left", "right")):
        joint = stance.skeleton.humanoid_bones.index(f"{side}Foot")
        middle = stance.places[joint] + stance.turns[joint] @ np.array([0, -0.03, 0.07])
        for material, solid, count in ((SHOES, upper, 1500), (SOLES, sole, 1300)):
            moved = _sides(stance, "Foot", solid)[index]
            low, high = middle - np.array([0.09, 0.13, 0.20]), middle + np.array([0.09, 0.15, 0.20])
            found.append(Piece(material, moved, low, high, 0.0036, count))
    return found
