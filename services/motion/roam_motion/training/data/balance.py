"""What the frames of an episode show, and how often frames of each kind are drawn.

Captured minutes are mostly slow walking; what a character is judged by is short: turning on the spot, setting off,
stopping, sitting down, rising. So each kind gets a share of its own, whatever its minutes.
"""

import numpy as np
from roam_character.kinematics import facing

from roam_motion.animation.state import FRAME_RATE
from roam_motion.training.data.episodes import Episode

# Shares of the drawn locomotion frames. Kinds that the clips lack leave theirs to the others.
GOING = {
    "idle": 0.12,
    "turn on the spot": 0.20,
    "start": 0.11,
    "stop": 0.12,
    "walk": 0.19,
    "brisk walk": 0.16,
    "sideways or backward": 0.05,
    "run": 0.05,
}
# Shares of the drawn frames of an interaction.
TAKING = {"approach": 0.17, "down": 0.33, "held": 0.18, "up": 0.26, "leaving": 0.06}
_STANDS, _GOES, _BRISK, _RUNS = 0.25, 0.6, 1.05, 1.85  # [m/s] of the hips along the floor
_TURNS = 0.6  # [rad/s]
_ASIDE = np.deg2rad(50)  # between facing and going
_WINDOW = round(0.25 * FRAME_RATE)  # frames either side over which speed and turning are taken
_SOON = round(0.7 * FRAME_RATE)  # frames within which someone sets off or stops
_TURN_SOON = round(0.5 * FRAME_RATE)
_BEFORE_DOWN = 25  # frames before the command to sit that belong to sitting down


def kinds_of_going(episode: Episode) -> np.ndarray:
    """Which of `GOING` each frame [T] of a locomotion episode is, as an index."""
    clip = episode.clip
    positions = clip.positions()
    velocity = _rate(positions[:, 0, [0, 2]])
    yaw = np.unwrap(facing(clip.skeleton, positions))
    speed, turning = np.linalg.norm(velocity, axis=-1), np.abs(_rate(yaw))
    before, after = _shifted(speed, -_SOON), _shifted(speed, _SOON)
    towards = np.arctan2(velocity[:, 0], velocity[:, 1])
    aside = np.abs((towards - yaw + np.pi) % (2 * np.pi) - np.pi) > _ASIDE
    soon = np.maximum(turning, _shifted(turning, _TURN_SOON))
    rules = {
        "run": speed > _RUNS,
        "start": (before < _STANDS) & (after > _GOES),
        "stop": (before > _GOES) & (after < _STANDS),
        "turn on the spot": (speed < 0.35) & (soon > _TURNS),
        "idle": speed < _STANDS,
        "sideways or backward": aside,
        "brisk walk": speed > _BRISK,
    }
    names = list(GOING)
    return np.asarray(
        np.select(list(rules.values()), [names.index(name) for name in rules], default=names.index("walk"))
    )


def kinds_of_taking(episode: Episode) -> np.ndarray:
    """Which of `TAKING` each frame [T] of an interaction is, as an index: by the hips' height and the commands."""
    count, names = len(episode.clip), list(TAKING)
    active = np.flatnonzero(episode.goal == 0)
    command, told = int(active[0]), int(active[-1]) + 1
    goal = episode.goals[0][0]
    away = np.linalg.norm(episode.clip.root_positions - goal.hips, axis=-1) > 0.03
    moving = np.flatnonzero(away[command:told])
    settled = command + int(moving[-1]) + 1 if len(moving) else command
    kinds = np.full(count, names.index("approach"))
    kinds[max(command - _BEFORE_DOWN, 0) : settled] = names.index("down")
    kinds[settled:told] = names.index("held")
    kinds[told:] = names.index("up")
    kinds[told:][episode.goal[told:] < 0] = names.index("leaving")
    return kinds


def balanced(kinds: list[np.ndarray], shares: dict[str, float]) -> list[np.ndarray]:
    """Weights of the frames of many episodes, one in all, so that each kind has its share."""
    counts = np.bincount(np.concatenate(kinds), minlength=len(shares)) if kinds else np.zeros(len(shares))
    wanted = np.where(counts > 0, np.array(list(shares.values())), 0.0)
    weights = wanted / max(wanted.sum(), 1e-9) / np.maximum(counts, 1)
    return [weights[own] for own in kinds]


def _rate(track: np.ndarray) -> np.ndarray:
    """Change per second of a track [T, ...], over a window."""
    at = np.arange(len(track))
    first, last = np.maximum(at - _WINDOW, 0), np.minimum(at + _WINDOW, len(track) - 1)
    seconds = np.maximum(last - first, 1) / FRAME_RATE
    return np.asarray((track[last] - track[first]) / seconds.reshape(-1, *[1] * (track.ndim - 1)))


def _shifted(values: np.ndarray, frames: int) -> np.ndarray:
    return np.asarray(values[np.clip(np.arange(len(values)) + frames, 0, len(values) - 1)])
