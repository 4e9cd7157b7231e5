"""How large a body is, beside the one that lengths were measured on.

Steps, places of feet and limits of speed are given for legs of 0.82 m, as the default skeleton has them; on another
skeleton they grow and shrink with its legs.
"""

from functools import cache

from roam_motion.animation.figure import Figure

_LEG = 0.82  # [m] from hip joint to ankle, of the default skeleton


@cache
def leg_length(figure: Figure) -> float:
    """From hip joint to ankle, stretched, mean of both legs [m]."""
    shin, foot = figure.legs[:, 1], figure.legs[:, 2]
    return float((figure.lengths[shin] + figure.lengths[foot]).mean())


@cache
def size(figure: Figure) -> float:
    """Times as large as the body that lengths are given for."""
    return leg_length(figure) / _LEG
