"""Shortest ways over the floor that keep a body's width from furniture.

Obstacles are outlines on the floor. Widened by a body's half width they are what nobody enters; the shortest way round
them goes from corner to corner. The corners' distances to the end are worked out once per goal, so that a frame only
asks which of them it can walk to.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from scipy.sparse.csgraph import dijkstra
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

Place = tuple[float, float]  # x, z [m]
Outline = tuple[Place, ...]  # corners of a floor polygon

_CLEARANCES = 0.50, 0.36, 0.24, 0.12  # [m] from the root to an outline; narrower only where there is no other way
_HAIR = 0.01  # [m] ways may touch the widened outlines
_SQUARE = 0.05  # [m]
_UNDER = 0.1  # [m] from an outline, hips are still over its furniture
_DEEPEST = 1.2  # [m] from the hips to the front of a seat
_PORCH = 0.9  # [m] longest way between furniture, straight ahead of the seat
_PORCH_WIDTH = 0.5  # [m]


@dataclass(frozen=True, eq=False)
class Ways:
    """All shortest ways to one place."""

    blocked: BaseGeometry  # widened outlines, with a porch before the seat
    core: BaseGeometry  # the same, a hair narrower: what no way crosses
    corners: np.ndarray  # [N, 2] the end first
    costs: np.ndarray  # [N] way from each corner to the end [m]
    following: np.ndarray  # [N] next corner on that way

    def way_from(self, start: Place) -> tuple[Place, ...] | None:
        """The way's corners after `start`, the end included; None when furniture shuts it off."""
        outside = self._outside(start)
        seen = _in_sight(self.core, np.broadcast_to(outside, self.corners.shape), self.corners)
        costs = np.where(seen, np.linalg.norm(self.corners - outside, axis=-1) + self.costs, np.inf)
        corner = int(costs.argmin())
        if not np.isfinite(costs[corner]):
            return None
        way = [_place(self.corners[corner])] if outside == start else [outside, _place(self.corners[corner])]
        while corner != 0:
            corner = int(self.following[corner])
            way.append(_place(self.corners[corner]))
        return tuple(way)

    def _outside(self, start: Place) -> Place:
        """`start`, or the nearest place that is not too close to an obstacle."""
        point = Point(start)
        return _nearest(self.blocked.boundary, point) if self.blocked.contains(point) else start


def reachable(start: Place, end: Place, facing: Place, outlines: tuple[Outline, ...]) -> bool:
    """Whether any way leads from `start` to a standing place `end`, as `way` looks for it."""
    return any(_ways(end, facing, outlines, clearance).way_from(start) for clearance in _CLEARANCES)


def inside(place: Place, outlines: tuple[Outline, ...]) -> bool:
    """Whether a place is within an outline."""
    return any(Polygon(outline).contains(Point(place)) for outline in outlines)


def way(start: Place, end: Place, facing: Place, outlines: tuple[Outline, ...]) -> tuple[Place, ...]:
    """The shortest way from `start` to a standing place `end` in front of a seat that opens towards `facing` (unit).

    Returns its corners, both ends included. It keeps the widest clearance from `outlines` that leaves a way at all, and
    goes straight where none does. What is ahead is looked up for the middle of a small square round `start`: whoever
    walks asks thirty times a second.
    """
    x, z = (_SQUARE * round(coordinate / _SQUARE) for coordinate in start)
    return start, *_ahead((x, z), end, facing, outlines)


@lru_cache(maxsize=4096)
def _ahead(start: Place, end: Place, facing: Place, outlines: tuple[Outline, ...]) -> tuple[Place, ...]:
    """The corners of the way after `start`."""
    for clearance in _CLEARANCES:
        found = _ways(end, facing, outlines, clearance).way_from(start)
        if found is not None:
            return found
    return (end,)


def edge(seat: Place, facing: Place, outlines: tuple[Outline, ...]) -> float:
    """How far the furniture under `seat` reaches towards `facing` (unit) [m]; 0 when none is there."""
    under = [Polygon(outline) for outline in outlines if Polygon(outline).distance(Point(seat)) < _UNDER]
    ahead = LineString([seat, (seat[0] + _DEEPEST * facing[0], seat[1] + _DEEPEST * facing[1])])
    covered = shapely.get_coordinates(ahead.intersection(shapely.union_all(under)))
    return float(np.linalg.norm(covered - seat, axis=-1).max(initial=0.0))


@lru_cache(maxsize=256)
def _ways(end: Place, facing: Place, outlines: tuple[Outline, ...], clearance: float) -> Ways:
    widened = shapely.union_all([Polygon(outline).buffer(clearance, quad_segs=2) for outline in outlines])
    blocked = widened.difference(_porch(widened, end, facing))
    core = blocked.buffer(-_HAIR)
    shapely.prepare(core)
    around = shapely.get_coordinates(blocked.buffer(_HAIR, quad_segs=1, join_style="mitre"))
    corners = np.array([end, *around])
    first, second = np.triu_indices(len(corners), 1)
    seen = _in_sight(core, corners[first], corners[second])
    lengths = np.zeros((len(corners), len(corners)))  # zero: not in sight
    lengths[first, second] = np.where(seen, np.linalg.norm(corners[first] - corners[second], axis=-1) + 1e-6, 0)
    costs, following = dijkstra(lengths, directed=False, indices=[0], return_predecessors=True)
    return Ways(blocked, core, corners, costs[0], following[0])


def _in_sight(core: BaseGeometry, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Whether one can walk straight from each start [N, 2] to its end [N, 2]."""
    return np.asarray(~shapely.intersects(core, shapely.linestrings(np.stack([starts, ends], 1))))


def _porch(widened: BaseGeometry, end: Place, facing: Place) -> BaseGeometry:
    """The strip that leads to a standing place close to the furniture: straight ahead of the seat, or the shortest."""
    ahead = LineString([end, (end[0] + _PORCH * facing[0], end[1] + _PORCH * facing[1])]).difference(widened)
    doorstep = _nearest(widened.boundary if ahead.is_empty else ahead, Point(end))
    return LineString([end, doorstep]).buffer(_PORCH_WIDTH / 2, quad_segs=2)


def _nearest(shape: BaseGeometry, point: Point) -> Place:
    """The place of `shape` nearest to `point`."""
    return _place(shapely.get_coordinates(shapely.shortest_line(shape, point))[0])


def _place(point: np.ndarray) -> Place:
    return float(point[0]), float(point[1])
