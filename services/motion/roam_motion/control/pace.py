"""How fast characters can go: what people do at that speed, and what the network does well.

A wanted velocity beyond it is cut, its direction kept; whoever asked can see what is followed instead.
"""

import math

import numpy as np

from roam_motion.control.intent import Steer

# [m/s] ahead, aside, back. With these weights no frame is without a foot on the ground at 1.5 m/s ahead, one in nine at
# 1.7; aside and back wanted speeds are held within 5 % up to here, and people hardly go faster.
_FASTEST = 1.6, 0.9, 0.9
_STILL = 0.05  # [m/s] slower than this is standing


def fastest(angle: float) -> float:
    """The greatest speed [m/s] in a direction that is `angle` [rad] from where the body faces: an ellipse."""
    ahead, aside, back = _FASTEST
    along = math.cos(angle) / (ahead if math.cos(angle) > 0 else back)
    return 1 / math.hypot(along, math.sin(angle) / aside)


def followed(steer: Steer) -> tuple[float, float]:
    """The velocity (x, z) [m/s] that is really followed: the wanted one, or as fast as can be in its direction."""
    x, z = float(steer.velocity[0]), float(steer.velocity[1])
    speed = math.hypot(x, z)
    if speed < _STILL:
        return x, z
    angle = 0.0
    if steer.facing is not None:
        dx, dz = float(steer.facing[0]), float(steer.facing[1])
        angle = math.atan2(x, z) - math.atan2(dx, dz)
    share = min(1.0, fastest(angle) / speed)
    return x * share, z * share


def cut_to(steer: Steer) -> float | None:
    """The speed [m/s] that a wanted velocity is cut to; None where it is followed as asked."""
    wanted, kept = float(np.hypot(*steer.velocity[:2])), math.hypot(*followed(steer))
    return kept if kept < wanted - 1e-6 else None
