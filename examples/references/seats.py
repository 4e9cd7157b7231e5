"""Reference objects, made of the same solids as the training furniture and fitted to the authored poses [m]."""

import numpy as np
import numpy.typing as npt
from roam_goalpose.furniture.piece import Furniture
from roam_goalpose.furniture.solids import Box, Loft, Pillow, Solid, Tube

Array = npt.NDArray[np.float64]


def pitch(degrees: float) -> Array:
    """Rotation about +X: positive leans forward."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def block(low: tuple[float, float, float], high: tuple[float, float, float], *, round_by: float = 0.01) -> Box:
    """An upright box between two corners."""
    a, b = np.array(low, float), np.array(high, float)
    return Box(center=(a + b) / 2, half=(b - a) / 2, radius=round_by)


def back_panel(
    foot: tuple[float, float],
    *,
    lean: float,
    height: float,
    half_width: float,
    thickness: float,
    round_by: float = 0.01,
) -> Box:
    """A reclined panel whose front face starts at `foot` (y, z) and leans back by `lean` degrees."""
    turn = pitch(-lean)
    center = np.array([0.0, *foot]) + turn @ np.array([0.0, height / 2, -thickness / 2])
    return Box(center=center, rotation=turn, half=np.array([half_width, height / 2, thickness / 2]), radius=round_by)


def four_legs(half_x: float, front: float, rear: float, height: float, *, thickness: float = 0.02) -> list[Solid]:
    """Square legs under the corners of a seat."""
    return [
        block((x - thickness, 0.0, z - thickness), (x + thickness, height, z + thickness), round_by=0.004)
        for x in (-half_x, half_x)
        for z in (front, rear)
    ]


def dining_chair(*, seat: float, foot: float, lean: float) -> Furniture:
    """Seat plate, four legs, two posts with a panel between; the back's front face starts at z = `foot` on the seat."""
    solids = [
        block((-0.215, seat - 0.045, -0.215), (0.215, seat, 0.215), round_by=0.015),
        *four_legs(0.19, 0.19, -0.19, seat - 0.03),
        back_panel(
            (seat + 0.08, foot - 0.08 * np.tan(np.radians(lean))),
            lean=lean,
            height=0.42,
            half_width=0.20,
            thickness=0.03,
        ),
    ]
    for x in (-0.185, 0.185):
        turn = pitch(-lean)
        center = np.array([x, seat, foot]) + turn @ np.array([0.0, 0.2, -0.02])
        solids.append(Box(center=center, rotation=turn, half=np.array([0.018, 0.24, 0.018])))
    return Furniture("chair", tuple(solids), np.array([[0.0, seat, 0.0]]))


def sofa(
    *, seat: float, foot: float, lean: float, half_width: float, arm: float, arm_height: float, front: float
) -> Furniture:
    """A base, one long cushion, a thick reclined back and two block arms."""
    rear = foot - 0.30
    inner = half_width - arm
    solids = [
        block((-inner, 0.05, rear + 0.05), (inner, seat - 0.13, front - 0.03), round_by=0.02),
        block((-inner, seat - 0.14, foot - 0.08), (inner, seat, front), round_by=0.04),
        back_panel(
            (seat - 0.12, foot + 0.12 * np.tan(np.radians(lean))),
            lean=lean,
            height=0.60,
            half_width=inner,
            thickness=0.17,
            round_by=0.05,
        ),
        *(
            block((min(a, b), 0.05, rear), (max(a, b), arm_height, front), round_by=0.04)
            for a, b in ((inner, half_width), (-half_width, -inner))
        ),
        block((-inner, 0.05, rear), (inner, 0.55, rear + 0.12), round_by=0.02),
        *four_legs(half_width - 0.06, front - 0.06, rear + 0.06, 0.08),
    ]
    return Furniture("sofa", tuple(solids), np.array([[0.0, seat, 0.0]]))


def armchair(
    *, seat: float, foot: float, lean: float, inner: float, arm: float, arm_height: float, front: float
) -> Furniture:
    """A one-seat upholstered chair: a short sofa."""
    made = sofa(seat=seat, foot=foot, lean=lean, half_width=inner + arm, arm=arm, arm_height=arm_height, front=front)
    return Furniture("armchair", made.solids, made.seats)


def open_armchair(*, seat: float, foot: float, lean: float, arm_half: float, arm_height: float) -> Furniture:
    """A wooden chair with arms on posts."""
    chair = dining_chair(seat=seat, foot=foot, lean=lean)
    solids: list[Solid] = []
    for x in (-arm_half, arm_half):
        solids.append(block((x - 0.022, arm_height - 0.03, foot - 0.05), (x + 0.022, arm_height, 0.17)))
        solids.append(block((x - 0.018, seat - 0.03, 0.12), (x + 0.018, arm_height - 0.02, 0.156), round_by=0.004))
        solids.append(
            block(
                (min(0.19 * np.sign(x), x), seat - 0.04, 0.12),
                (max(0.19 * np.sign(x), x), seat - 0.01, 0.156),
                round_by=0.004,
            )
        )
    return Furniture("armchair", chair.solids + tuple(solids), chair.seats)


def stool(*, seat: float, half: float) -> Furniture:
    """A square seat on four legs with rungs."""
    rungs = [
        block((-half, 0.15, z - 0.012), (half, 0.175, z + 0.012), round_by=0.004) for z in (-half + 0.03, half - 0.03)
    ]
    solids = [
        block((-half, seat - 0.04, -half), (half, seat, half), round_by=0.012),
        *four_legs(half - 0.03, half - 0.03, -half + 0.03, seat - 0.02),
        *rungs,
    ]
    return Furniture("stool", tuple(solids), np.array([[0.0, seat, 0.0]]))


def bar_stool(*, seat: float, radius: float, ring: float) -> Furniture:
    """A round seat on four splayed legs with a foot ring at height `ring`."""
    angles = np.linspace(0, 2 * np.pi, 33)
    circle = np.stack([0.19 * np.sin(angles), np.full(33, ring), 0.19 * np.cos(angles)], -1)
    legs = [
        Tube(path=np.array([[0.12 * sx, seat - 0.03, 0.12 * sz], [0.16 * sx, 0.0, 0.16 * sz]]), radius=0.016)
        for sx in (-1, 1)
        for sz in (-1, 1)
    ]
    plate = Loft(heights=np.array([seat - 0.05, seat]), half=np.full((2, 2), radius), power=2.0)
    return Furniture("barstool", (plate, Tube(path=circle, radius=0.012), *legs), np.array([[0.0, seat, 0.0]]))


def office_chair(*, seat: float, foot: float, lean: float, arm_height: float) -> Furniture:
    """A padded seat on a column with a five-armed star, a padded back, and T-shaped armrests."""
    star = [
        Tube(path=np.array([[0.0, 0.09, 0.0], [0.30 * np.sin(a), 0.05, 0.30 * np.cos(a)]]), radius=0.022)
        for a in 2 * np.pi * (np.arange(5) / 5)
    ]
    castors = [
        block(
            (0.30 * np.sin(a) - 0.025, 0.0, 0.30 * np.cos(a) - 0.025),
            (0.30 * np.sin(a) + 0.025, 0.055, 0.30 * np.cos(a) + 0.025),
        )
        for a in 2 * np.pi * (np.arange(5) / 5)
    ]
    arms: list[Solid] = []
    for x in (-0.30, 0.30):
        arms.append(block((x - 0.035, arm_height - 0.03, -0.14), (x + 0.035, arm_height, 0.11), round_by=0.012))
        arms.append(block((x - 0.015, seat - 0.05, -0.04), (x + 0.015, arm_height - 0.01, 0.02)))
        arms.append(block((min(0.0, x), seat - 0.07, -0.04), (max(0.0, x), seat - 0.045, 0.02)))
    solids = [
        block((-0.24, seat - 0.075, -0.23), (0.24, seat, 0.23), round_by=0.035),
        back_panel(
            (seat + 0.08, foot - 0.08 * np.tan(np.radians(lean))),
            lean=lean,
            height=0.52,
            half_width=0.22,
            thickness=0.06,
            round_by=0.025,
        ),
        back_panel((seat - 0.05, foot - 0.07), lean=lean, height=0.22, half_width=0.03, thickness=0.03),
        Tube(path=np.array([[0.0, 0.06, 0.0], [0.0, seat - 0.04, 0.0]]), radius=0.03),
        *star,
        *castors,
        *arms,
    ]
    return Furniture("officechair", tuple(solids), np.array([[0.0, seat, 0.0]]))


def lounger(*, seat: float, foot: float, lean: float, half_width: float, front: float) -> Furniture:
    """A long mat on legs, flat under the sitter's, whose back rises from z = `foot`, `lean` degrees from upright."""
    solids = [
        block((-half_width, seat - 0.07, foot - 0.03), (half_width, seat, front), round_by=0.02),
        back_panel((seat - 0.01, foot), lean=lean, height=0.80, half_width=half_width, thickness=0.06, round_by=0.02),
        *four_legs(half_width - 0.05, front - 0.08, foot - 0.02, seat - 0.05),
        block((-half_width + 0.03, 0.0, foot - 0.42), (half_width - 0.03, seat + 0.16, foot - 0.38), round_by=0.004),
    ]
    return Furniture("lounger", tuple(solids), np.array([[0.0, seat, 0.0]]))


def bench(*, seat: float, half_width: float, depth: float) -> Furniture:
    """A plank on two panels, no back."""
    solids = [
        block((-half_width, seat - 0.045, -depth / 2), (half_width, seat, depth / 2), round_by=0.008),
        *(
            block((x - 0.02, 0.0, -depth / 2 + 0.03), (x + 0.02, seat - 0.03, depth / 2 - 0.03), round_by=0.004)
            for x in (0.12 - half_width, half_width - 0.12)
        ),
        block((0.12 - half_width, 0.18, -0.015), (half_width - 0.12, 0.25, 0.015), round_by=0.004),
    ]
    return Furniture("bench", tuple(solids), np.array([[0.0, seat, 0.0]]))


def bed(*, top: float, half_width: float, length: float, pillow: float) -> Furniture:
    """A mattress on a frame along x, head at +x, with a head board and a pillow."""
    half = length / 2
    solids = [
        block((-half, 0.08, -half_width), (half, top - 0.16, half_width), round_by=0.01),
        block((-half + 0.02, top - 0.18, -half_width + 0.02), (half - 0.02, top, half_width - 0.02), round_by=0.05),
        block((half, 0.0, -half_width), (half + 0.05, top + 0.45, half_width), round_by=0.01),
        Pillow(center=np.array([half - 0.25, top + 0.02, 0.0]), half=np.array([0.20, pillow, 0.33])),
        *four_legs(half - 0.05, half_width - 0.05, -half_width + 0.05, 0.1, thickness=0.03),
    ]
    return Furniture("bed", tuple(solids), np.array([[0.0, top, 0.0]]))
