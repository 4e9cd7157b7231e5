"""The body's centre of mass from joint positions (segment masses and centres after Winter, Biomechanics and Motor
Control of Human Movement, table 4.1), and whether it is over the feet."""

import numpy as np
from roam_character.skeleton import Skeleton

# Share of the body's mass, joint it hangs from, joint it ends in, and where between the two its centre is.
_TRUNK, _HEAD = 0.497, 0.081
_LIMBS = (
    (0.028, "UpperArm", "LowerArm", 0.436),
    (0.016, "LowerArm", "Hand", 0.430),
    (0.006, "Hand", "Hand", 0.0),
    (0.100, "UpperLeg", "LowerLeg", 0.433),
    (0.0465, "LowerLeg", "Foot", 0.433),
    (0.0145, "Foot", "Toes", 0.5),
)
_CROWN = 1.2  # the head's centre, in lengths of the neck over the neck's joint


def centre_of_mass(skeleton: Skeleton, positions: np.ndarray) -> np.ndarray:
    """Joint positions [..., J, 3] [m] -> [..., 3] [m]."""

    def at(name: str) -> np.ndarray:
        return np.asarray(positions[..., skeleton.index(name), :])

    hips = (at("leftUpperLeg") + at("rightUpperLeg")) / 2
    total = _TRUNK * (hips + at("neck")) / 2 + _HEAD * (at("neck") + _CROWN * (at("head") - at("neck")))
    for mass, start, end, share in _LIMBS:
        for side in ("left", "right"):
            total = total + mass * (at(side + start) * (1 - share) + at(side + end) * share)
    # The trunk, the head and twelve segments of limbs weigh one in all.
    return np.asarray(total)


def lean(skeleton: Skeleton, positions: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """Angle of the trunk (neck over mid-hip) against the vertical, forward positive. [T, J, 3], [T, 2] -> [T] [deg]."""
    hips = positions[:, skeleton.indices(["leftUpperLeg", "rightUpperLeg"])].mean(1)
    trunk = positions[:, skeleton.index("neck")] - hips
    return np.asarray(np.rad2deg(np.arctan2((trunk[:, [0, 2]] * ahead).sum(-1), trunk[:, 1])))


def ahead_of_rear_ankle(skeleton: Skeleton, positions: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """How far the centre of mass is in front of the rear ankle. [T, J, 3], facing [T, 2] -> [T] [m]."""
    mass = centre_of_mass(skeleton, positions)[:, [0, 2]]
    ankles = positions[:, skeleton.indices(["leftFoot", "rightFoot"])][..., [0, 2]]
    return np.asarray(((mass[:, None] - ankles) * ahead[:, None]).sum(-1).max(1))
