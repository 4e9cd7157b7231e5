"""Sitting down, sitting, standing up: found from the height of the hips, the same way for captured people and ours."""

from dataclasses import dataclass

import numpy as np

from roam_evaluation.motion.people.frames import ANKLES, HANDS, HEAD, HIPS, RATE, Motion
from roam_evaluation.motion.people.measures.posture import centre_of_mass, lean, smooth, speed

_TOUCH = 0.015  # [m] over the seated height: the seat is touched, or left
_STARTED = 0.12  # share of the way down from which the hips sink
_CLOSE = 0.05  # [m] mean distance of the joints from the pose of rest: arrived
_QUIET = 0.12  # [m/s] mean speed of the joints, over half a second, of somebody who has come to rest
_LEAST = 0.15  # [m] hips sink at least so far
_BEFORE = 75  # frames of standing looked at before
SECONDS_2 = 60  # frames
_LAST = 9  # frames: 0.3 s before arrival


@dataclass(frozen=True, eq=False)
class Sit:
    """One sitting: what comes before, the stretch held, what comes after."""

    motion: Motion
    first: int  # seated from here …
    last: int  # … to here

    @property
    def seated_height(self) -> float:
        """Median height of the hips while seated [m]."""
        return float(np.median(self.motion.positions[self.first : self.last + 1, HIPS, 1]))


@dataclass(frozen=True, eq=False)
class Passage:
    """Going down to a seat, or up from it (then in the order of time too)."""

    begun: int  # frame at which the hips begin to move down, or have come up
    half: int  # hips half-way
    touch: int  # the seat is touched, or left


def sits(motion: Motion) -> list[Sit]:
    """The sittings that a motion's labels name (`sit held`)."""
    return [Sit(motion, s.first, s.last) for s in motion.stretches if s.label == "sit held"]


def seat_height(sit: Sit) -> float:
    """Height of the seat [m]: of the hip joints, minus 8.5 cm (the captured set's own rule)."""
    return float(np.median(sit.motion.hips[sit.first : sit.last + 1, 1])) - 0.085


def _passage(height: np.ndarray, held: int, seated: float) -> Passage | None:
    """The way down in heights [T] of hips that are held at `seated` [m] from frame `held` on."""
    standing = float(np.quantile(height[max(0, held - _BEFORE) : held + 1], 0.9))
    drop = standing - seated
    above = np.flatnonzero(height[: held + 1] > seated + drop / 2)
    if drop < _LEAST or not len(above):
        return None
    half = int(above[-1])
    tall = np.flatnonzero(height[: half + 1] > standing - _STARTED * drop)
    low = np.flatnonzero(height[half:] < seated + _TOUCH)
    return Passage(int(tall[-1]), half, half + int(low[0])) if len(tall) and len(low) else None


def way_down(sit: Sit) -> Passage | None:
    """The way down to a seat; None when the motion begins seated."""
    height = smooth(sit.motion.positions[:, HIPS, 1], 3)
    seated = float(np.median(height[sit.first : min(sit.last, sit.first + 30) + 1]))
    return _passage(height[: sit.last + 1], sit.first, seated)


def way_up(sit: Sit) -> Passage | None:
    """The way up from a seat; None when the motion ends seated."""
    height = smooth(sit.motion.positions[:, HIPS, 1], 3)
    seated = float(np.median(height[max(sit.first, sit.last - 30) : sit.last + 1]))
    end = len(height) - 1
    found = _passage(height[sit.first :][::-1], end - sit.last, seated)
    return found and Passage(end - found.begun, end - found.half, end - found.touch)


def measure_down(sit: Sit) -> dict[str, float] | None:
    """Measures of sitting down."""
    way = way_down(sit)
    if way is None:
        return None
    motion, hips = sit.motion, sit.motion.positions[:, HIPS]
    facing = np.full(len(motion), motion.facing[way.touch])
    forward = (hips[:, 0] * np.sin(facing)) + hips[:, 2] * np.cos(facing)
    rest = _arrival(sit, way.touch)
    feet = motion.positions[:, ANKLES][..., [0, 2]]
    until = rest[0] if rest else min(way.touch + 30, len(motion) - 1)
    out = {
        "lean_down": float(lean(motion)[max(way.begun - 15, 0) : way.touch + 8].max()),
        "balance_half_down": 100 * _balance(motion, way.half, "rear"),
        "descent": (way.touch - way.begun) / RATE,
        "hips_back": 100 * float(forward[way.begun] - forward[way.touch]),
        "hips_speed_at_contact": float(speed(hips[:, [0, 2]])[way.touch]),
        "feet_after_half": 100 * float(np.linalg.norm(feet[until] - feet[way.half], axis=-1).mean()),
        "feet_after_contact": 100 * float(np.linalg.norm(feet[until] - feet[way.touch], axis=-1).mean()),
    }
    return {**out, **_resting(sit, way.touch, rest)}


def _balance(motion: Motion, frame: int, over: str) -> float:
    """Centre of mass in front of the rear ankle, or of the middle of both [m]."""
    ankles = motion.ahead(motion.positions[:, ANKLES])[frame]
    mass = motion.ahead(centre_of_mass(motion.positions)[:, None])[frame, 0]
    return float(mass - (ankles.min() if over == "rear" else ankles.mean()))


def _arrival(sit: Sit, touch: int) -> tuple[int, np.ndarray] | None:
    """When the pose of rest is reached within 5 cm, and that pose [J, 3]: the mean of the first quiet half second after
    the seat is touched."""
    positions = sit.motion.positions
    pace = smooth(speed(positions).mean(1), 15)
    quiet = np.flatnonzero(pace[touch + 7 : sit.last + 1] < _QUIET)
    if not len(quiet):
        return None
    middle = touch + 7 + int(quiet[0])
    pose = positions[middle - 3 : min(middle + 8, len(positions))].mean(0)
    away = np.linalg.norm(positions - pose, axis=-1).mean(1)
    far = np.flatnonzero(away[: middle + 1] > _CLOSE)
    return (int(far[-1]) + 1 if len(far) else touch), pose


def _resting(sit: Sit, touch: int, rest: tuple[int, np.ndarray] | None) -> dict[str, float]:
    if rest is None:
        return {}
    arrived, positions = rest[0], sit.motion.positions
    last = slice(max(arrived - _LAST, 0), max(arrived, 1))
    pace = {
        "hips": speed(positions[:, HIPS]),
        "hands": speed(positions[:, HANDS]).mean(1),
        "feet": speed(positions[:, ANKLES]).mean(1),
    }
    return {
        "contact_to_rest": (arrived - touch) / RATE,
        **{f"{part}_speed_on_arrival": float(values[last].mean()) for part, values in pace.items()},
    }


def measure_up(sit: Sit) -> dict[str, float] | None:
    """Measures of standing up."""
    way = way_up(sit)
    if way is None:
        return None
    motion = sit.motion
    ankles = motion.ahead(motion.positions[:, ANKLES])[way.touch]
    return {
        "lean_up": float(lean(motion)[max(way.touch - 30, 0) : way.begun + 1].max()),
        "balance_leaving": 100 * _balance(motion, way.touch, "both"),
        "rise": (way.begun - way.touch) / RATE,
        "ankles_ahead_leaving": 100 * float(ankles.mean()),
    }


def seated(sit: Sit) -> tuple[int, int]:
    """Frames from a second after the seat is touched to a second before it is left."""
    down, up = way_down(sit), way_up(sit)
    first = max((down.touch if down else 0) + 30, sit.first)
    return first, min((up.touch if up else len(sit.motion)) - 30, sit.last)


def measure_seated(sit: Sit) -> list[dict[str, float]]:
    """Spreads within every 2 s of sitting."""
    first, last = seated(sit)
    found = []
    for begin in range(first, last - SECONDS_2 + 1, SECONDS_2):
        part = sit.motion.positions[begin : begin + SECONDS_2]
        spreads = np.sqrt(((part - part.mean(0)) ** 2).sum(-1).mean(0))
        found.append(
            {
                "seated_hips": 100 * float(spreads[HIPS]),
                "seated_head": 100 * float(spreads[HEAD]),
                "seated_hands": 100 * float(spreads[HANDS].mean()),
            }
        )
    return found
