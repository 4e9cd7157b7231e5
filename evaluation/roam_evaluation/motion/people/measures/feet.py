"""Feet over a whole motion: twist under the pelvis, slides by height and speed, and what benchmarks report."""

import numpy as np

from roam_evaluation.motion.people.frames import ANKLES, HIPS, RATE, TOES, Motion
from roam_evaluation.motion.people.measures.posture import runs, twist

_UPRIGHT = 0.80  # [m] hips: who walks, turns or stands
_TWISTED = 73.0  # [degrees] the 99th percentile of captured people
_TOE_LOW = 0.05  # [m] Kimodo's benchmark: a toe joint so low touches the floor
_TOE_FAST = 0.20  # [m/s] and skates when faster
_GROUND = 0.02  # [m] over its lowest twentieth: a joint that carries weight
_MOVES = 0.30  # [m/s] and does not travel
_SHORTEST = 4  # frames of a contact; its first and last one, in which the foot lands and leaves, are not counted


def measure(motion: Motion) -> dict[str, float]:
    """All measures of the feet of one motion that stands, walks or turns for a second or more; else NaN."""
    upright = motion.positions[:, HIPS, 1] > _UPRIGHT
    twisted = twist(motion)[upright]
    if len(twisted) < RATE:
        return {}
    return {
        "twist_p50": float(np.nanmedian(twisted)),
        "twist_p99": float(np.nanquantile(twisted, 0.99)),
        "twisted_share": 100 * float((np.nan_to_num(twisted) > _TWISTED).any(1).mean()),
        **benchmark(motion.positions),
        **slides(motion.positions, upright),
    }


def benchmark(positions: np.ndarray) -> dict[str, float]:
    """Toe skate and skate ratio as Kimodo's benchmark defines them (documentation of its metrics, 2026).

    Skate: mean speed of the toe joints in frames in which they are lower than 5 cm [cm/s]. Ratio: share of frames, of
    those in which a toe joint is lower than 5 cm in this and the next frame, in which it is faster than 0.2 m/s [%].
    """
    toes = positions[:, TOES]
    low = toes[..., 1] < _TOE_LOW
    speed = np.linalg.norm(np.diff(toes, axis=0), axis=-1) * RATE
    both = low[:-1] & low[1:]
    return {
        "toe_skate": 100 * float(speed[low[:-1]].mean()) if low[:-1].any() else float("nan"),
        "skate_ratio": 100 * float((speed[both] > _TOE_FAST).mean()) if both.any() else float("nan"),
    }


def slides(positions: np.ndarray, where: np.ndarray | None = None) -> dict[str, float]:
    """How far a joint of a foot travels along the floor in a contact, by height and speed [cm], mean and 95th
    percentile: within 2 cm of its lowest twentieth, slower than 0.3 m/s, four frames or longer, landing and leaving
    not counted."""
    points = np.stack([positions[:, ANKLES], positions[:, TOES]], 2)
    height = points[..., 1]
    ground = np.quantile(height if where is None else height[where], 0.05, axis=0)
    pace = np.linalg.norm(np.gradient(points[..., [0, 2]], axis=0), axis=-1) * RATE
    carries = (height < ground + _GROUND) & (pace < _MOVES)
    if where is not None:
        carries &= where[:, None, None]
    found = []
    for side in (0, 1):
        for part in (0, 1):
            for first, last in runs(carries[:, side, part], _SHORTEST):
                track = points[first + 1 : last, side, part][:, [0, 2]]
                found.append(float(np.linalg.norm(track - track[0], axis=-1).max()))
    if not found:
        return {"slide": float("nan"), "slide_p95": float("nan")}
    return {"slide": 100 * float(np.mean(found)), "slide_p95": 100 * float(np.quantile(found, 0.95))}
