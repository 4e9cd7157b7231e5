"""Uploads that stand on an edge or a corner, and how they would stand on their feet.

An object stands when its centre is over the hull of what touches the floor. One that does not was turned by whoever
exported it. The planes on which it could stand are facets of its convex hull; which of them is the floor is for the
score of `upright` to say, as between Y and Z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError

from roam_goalpose.objects.geometry import Array, triangle_areas
from roam_goalpose.objects.placing.upright import score_turned

Directions = npt.NDArray[np.floating]

_TOUCH = 0.015  # [m] what is this near the lowest point touches the floor
_STEADY = 0.01  # [m] that the centre lies inside the base at least
_APART = math.cos(math.radians(6))  # facets closer than this are one floor
_FLOORS = 24  # planes that are looked at: those of the largest facets
_LEAST = math.radians(4)  # less is a foot that is a little short
_SURE = 3.0  # log-odds: 95 %
FARTHEST = math.radians(60)  # from an up axis that the format promises


@dataclass(frozen=True, eq=False)
class Tilt:
    """The turn `[3, 3]` that sets an object on its feet, and by how much more it looks like furniture then."""

    turn: Array
    gain: float  # log-odds

    @property
    def angle(self) -> float:
        """Between the object's up and the vertical [rad]."""
        return math.acos(min(1.0, float(self.turn[1, 1])))

    @property
    def sure(self) -> bool:
        """Whether to set it on its feet unasked."""
        return self.gain > _SURE


def surface_centre(triangles: Array, areas: Array | None = None) -> Array:
    """The middle `[3]` of the surface of `[F, 3, 3]` triangles (of `areas` `[F]` if they are known)."""
    areas = triangle_areas(triangles) if areas is None else areas
    return np.asarray(areas @ triangles.mean(axis=1) / max(float(areas.sum()), 1e-12))


def stands(vertices: Array, centre: Array, *, touch: float | None = None) -> bool:
    """Whether an object of `vertices` `[N, 3]` [m], +Y up, with its `centre` `[3]` stays as it is on a level floor.

    What is within `touch` [m] of the lowest point touches the floor: more in a scan, which has noise.
    """
    touching = vertices[vertices[:, 1] < vertices[:, 1].min() + (touch or _TOUCH)]
    if len(touching) < 3:
        return False
    try:
        base = ConvexHull(touching[:, ::2])
    except QhullError:  # all on one line
        return False
    return float((base.equations[:, :2] @ centre[::2] + base.equations[:, 2]).max()) < -_STEADY


def find_tilt(
    vertices: Array,
    points: Array,
    normals: Directions,
    *,
    centre: Array,
    farthest: float,
    touch: float | None = None,
) -> Tilt | None:
    """How an object that does not stand would stand on its feet; None when nothing is found, or it leans but little.

    Args:
        vertices: `[N, 3]` [m], +Y up as far as is known.
        points: `[M, 3]` [m] shuffled samples of its surface.
        normals: `[M, 3]` of the samples, of either sign.
        centre: `[3]` what should be over the base.
        farthest: how far the vertical may be from the true one [rad].
        touch: see `stands`.
    """
    found = []
    for up in possible_ups(vertices):
        turn = turn_to_y(up)
        if up[1] > math.cos(farthest) and stands(vertices @ turn.T, turn @ centre, touch=touch):
            found.append((score_turned(points, normals, turn), turn))
    if not found:
        return None
    score, turn = max(found, key=lambda one: one[0])
    tilt = Tilt(turn, score - score_turned(points, normals, np.eye(3)))
    return tilt if tilt.angle > _LEAST else None


def possible_ups(vertices: Array) -> list[Array]:
    """Directions away from the largest facets of the convex hull, each several degrees from the others."""
    try:
        hull = ConvexHull(vertices)
    except QhullError:
        return []
    corners = vertices[hull.simplices]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    chosen: list[Array] = []
    for k in np.argsort(-area, kind="stable"):
        up = -hull.equations[k, :3]
        if all(up @ other < _APART for other in chosen):
            chosen.append(up)
        if len(chosen) == _FLOORS:
            break
    return chosen


def turn_to_y(up: Array) -> Array:
    """The smallest rotation `[3, 3]` that takes the unit direction `up` to +Y; half a turn about +X from −Y."""
    x, y, z = up
    if y < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    skew = np.array([[0.0, -x, 0.0], [x, 0.0, z], [0.0, -z, 0.0]])
    return np.eye(3) + skew + skew @ skew / (1 + y)
