"""Steering keeps out of furniture: whoever is steered at it slides along it, or stops before it.

What is known is what the last goal named (`left_behind`): its obstacles, or the outline of its furniture, or the room
that its pose takes up. Of a wanted velocity only what leads towards an outline is cut, the more the nearer it is, so
that the way along it and away from it stays free, also for somebody who stands too near or inside already.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from roam_character.volume import Volume

from roam_motion.animation.figure import Figure
from roam_motion.animation.proportions import size
from roam_motion.control.actions import outlines_of
from roam_motion.control.intent import Goal, Intent
from roam_motion.control.paths import Outline, Place

# Tuned on characters steered at chairs, sofas and beds (`roam evaluate motion furniture`).
_CLEARANCE = 0.30  # [m] from the root to an outline, for legs of 0.82 m (see proportions.py)
_HALT = 0.5  # [s] in which somebody comes to stand: so far off an outline, walking towards it begins to be slowed
_HEADROOM = 2.0  # [m] furniture higher than this is walked under


@dataclass(frozen=True, eq=False)
class _Edges:
    """All edges of some outlines."""

    starts: np.ndarray  # [N, 2] [m]
    ways: np.ndarray  # [N, 2] to their ends
    squares: np.ndarray  # [N] of their lengths
    begins: np.ndarray  # [K] where the edges of each outline begin


def left_behind(figure: Figure, intent: Intent) -> tuple[Outline, ...]:
    """The outlines that somebody keeps out of who was asked for `intent` before."""
    if not isinstance(intent, Goal):
        return intent.around
    if intent.obstacles or intent.volume is None:
        return outlines_of(figure, intent)
    outline = _footprint(intent.volume)
    return (outline,) if outline else ()


def kept_out(
    figure: Figure, outlines: tuple[Outline, ...], place: Place, velocity: tuple[float, float]
) -> tuple[float, float]:
    """The part of a `velocity` (x, z) [m/s] that somebody at `place` [m] can follow without coming too near."""
    if not outlines or not any(velocity):
        return velocity
    walls = _walls(_edges_of(outlines), place, _CLEARANCE * size(figure), math.hypot(*velocity) * _HALT)
    slid = velocity
    for wall in walls:
        slid = _along(slid, *wall)
    # In a corner the way along one outline leads into another.
    return slid if all(math.dist(slid, _along(slid, *wall)) < 1e-6 for wall in walls) else (0.0, 0.0)


def _along(velocity: tuple[float, float], x: float, z: float, left: float) -> tuple[float, float]:
    """A velocity that comes no faster towards a wall than its distance `left` [m] allows; it looks to (x, z)."""
    beyond = -(velocity[0] * x + velocity[1] * z) - max(left, 0.0) / _HALT
    return (velocity[0] + beyond * x, velocity[1] + beyond * z) if beyond > 0 else velocity


def _walls(edges: _Edges, place: Place, clearance: float, reach: float) -> list[tuple[float, float, float]]:
    """For every outline within reach the direction (unit) away from it and the distance left [m], the nearest first."""
    apart = np.array(place) - edges.starts
    share = np.clip((apart * edges.ways).sum(1) / edges.squares, 0.0, 1.0)
    away = apart - share[:, None] * edges.ways
    distance = np.hypot(away[:, 0], away[:, 1])
    crossed = _crossed(edges, apart)
    found = []
    for begin, end in zip(edges.begins, [*edges.begins[1:], len(distance)], strict=True):
        nearest = begin + int(distance[begin:end].argmin())
        inside = bool(crossed[begin:end].sum() % 2)
        gap = float(distance[nearest])
        left = (-gap if inside else gap) - clearance
        if left < reach and gap > 1e-9:
            x, z = ((-1.0 if inside else 1.0) * away[nearest] / gap).tolist()
            found.append((left, x, z))
    return [(x, z, left) for left, x, z in sorted(found)]


def _crossed(edges: _Edges, apart: np.ndarray) -> np.ndarray:
    """Whether a ray along +x from a place, `apart` [N, 2] from the edges' starts, crosses each edge [N]."""
    x, z = apart.T
    over, under = z >= 0, z < edges.ways[:, 1]
    straddles = over == under
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(straddles & (x < z / edges.ways[:, 1] * edges.ways[:, 0]))


@lru_cache(maxsize=512)
def _edges_of(outlines: tuple[Outline, ...]) -> _Edges:
    corners = [np.array(outline, float) for outline in outlines]
    ways = np.concatenate([np.roll(own, -1, 0) - own for own in corners])
    squares = np.maximum((ways * ways).sum(1), 1e-12)
    begins = np.cumsum([0, *(len(own) for own in corners[:-1])])
    return _Edges(np.concatenate(corners), ways, squares, begins)


@lru_cache(maxsize=256)
def _footprint(volume: Volume) -> Outline:
    """The convex outline of an object's matter below headroom; empty where there is none."""
    nodes = np.argwhere(volume.values <= 0)
    nodes = nodes[volume.origin[1] + volume.pitch * nodes[:, 1] < _HEADROOM]
    if not len(nodes):
        return ()
    x, z = (volume.pitch * nodes[:, [0, 2]]).T
    c, s = math.cos(volume.yaw), math.sin(volume.yaw)
    places = np.stack([c * x + s * z, c * z - s * x], 1) + volume.origin[[0, 2]]
    hull = shapely.MultiPoint(places).buffer(volume.pitch / 2, quad_segs=1).convex_hull
    return tuple((float(x), float(z)) for x, z in shapely.get_coordinates(hull)[:-1])
