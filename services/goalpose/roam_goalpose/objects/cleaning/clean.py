"""What a scan has beside its object: strays, a floor, walls. All that is left out is said."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from roam_goalpose.objects.cleaning.planes import Floor, Mask, find_floors, find_walls, strangeness
from roam_goalpose.objects.cleaning.strays import belongs
from roam_goalpose.objects.geometry import Geometry, Indices, triangle_areas
from roam_goalpose.objects.placing.axes import up_rotation
from roam_goalpose.objects.surfaces.surface import surface_samples

# How much stranger an object may look without its floor: floors are found by their place, and legs without their stool,
# which are far stranger, are not left over.
_STRANGER = 0.1
_LEAST_POINTS = 100  # that must stay
_FLAT_SHARE = 0.5  # of a floor's area that separate sheets must have to be all of it
_SCRAP_AREA = 0.005  # of the surface


@dataclass(frozen=True, eq=False)
class Cleaned:
    """An object without what lay around it.

    Attributes:
        geometry: what is left, with notes on what is not.
        floor: the plane that it stood on, in file coordinates; None when there was none.
    """

    geometry: Geometry
    floor: Floor | None


def clean(geometry: Geometry, *, up: str | None) -> Cleaned:
    """Cut off strays, floor and walls; `up` is the file's up axis if the sender says it."""
    geometry = _without_strays(geometry)
    axis = up or geometry.up
    known = None if axis is None else up_rotation(axis)[1]
    samples = surface_samples(geometry)
    floors = find_floors(*samples, up=known)
    if not floors:
        return Cleaned(geometry, None)
    found = [(floor, _without_strays(left)) for floor in floors if (left := _cut(geometry, floor)) is not None]
    looks = [strangeness(*surface_samples(left), up=floor.up) for floor, left in found]
    if not looks or min(looks) > strangeness(*samples, up=known) + _STRANGER:
        return Cleaned(geometry, None)
    floor, left = found[int(np.argmin(looks))]
    left = left.noted("OBJECT_FLOOR_CUT", "The floor under the object was cut off.")
    return Cleaned(_without_walls(left, floor), floor)


def _without_walls(geometry: Geometry, floor: Floor) -> Geometry:
    for wall in find_walls(*surface_samples(geometry), up=floor.up):
        left = _cut(geometry, wall)
        if left is not None:
            geometry = left.noted("OBJECT_FLOOR_CUT", "A wall beside the object was cut off.")
    return geometry


def _cut(geometry: Geometry, plane: Floor) -> Geometry | None:
    """Without what lies on a plane; None when next to nothing would be left."""
    covered = plane.covers(geometry.vertices)
    if geometry.faces is None:
        if int((~covered).sum()) < _LEAST_POINTS:
            return None
        return replace(geometry, vertices=geometry.vertices[~covered])
    flat: Mask = np.logical_and.reduce(covered[geometry.faces], axis=1)
    sheets: Mask = flat & _sheets(geometry, flat)
    areas = triangle_areas(geometry.triangles)
    gone = sheets if areas[sheets].sum() > _FLAT_SHARE * areas[flat].sum() else flat
    return None if gone.all() or not gone.any() else geometry.only(~gone)


def _sheets(geometry: Geometry, flat: Mask) -> Mask:
    """Triangles `[F]` of connected bodies that are flat altogether: a floor of its own, not an object's underside."""
    body = bodies(geometry)
    raised = np.bincount(body[~flat], minlength=int(body.max()) + 1) > 0
    mask: Mask = ~raised[body]
    return mask


def bodies(geometry: Geometry) -> Indices:
    """Which connected body each triangle `[F]` belongs to; vertices at the same place count as one."""
    assert geometry.faces is not None
    step = max(float(np.ptp(geometry.vertices, axis=0).max()), 1e-12) * 1e-6
    places = np.round((geometry.vertices - geometry.vertices.min(axis=0)) / step).astype(np.int64)
    keys = (places[:, 0] << 42) ^ (places[:, 1] << 21) ^ places[:, 2]
    _, place = np.unique(keys, return_inverse=True)
    corners = place[geometry.faces]
    count = int(place.max()) + 1
    ones = np.ones(2 * len(corners), dtype=np.int8)
    pairs = np.concatenate([corners[:, :2], corners[:, 1:]])
    graph = coo_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    labels = connected_components(graph, directed=False)[1]
    of: Indices = np.unique(labels[corners[:, 0]], return_inverse=True)[1]
    return of


def _without_strays(geometry: Geometry) -> Geometry:
    """Stray points of a cloud, tiny scraps of a mesh that lie far from the rest."""
    if geometry.faces is None:
        kept = belongs(geometry.vertices)
        if kept.all() or int(kept.sum()) < _LEAST_POINTS:
            return geometry
        left = replace(geometry, vertices=geometry.vertices[kept])
        return left.noted("OBJECT_POINTS_DROPPED", f"{int((~kept).sum())} stray points were left out.")
    return _without_scraps(geometry)


def _without_scraps(mesh: Geometry) -> Geometry:
    """Looked for only where the surface's samples do not reach to the box's ends."""
    assert mesh.faces is not None
    points, _ = surface_samples(mesh)
    box = np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
    low, high = np.quantile(points, [0.005, 0.995], axis=0)
    reach = 0.5 * float((high - low).max())
    if (box[0] > low - reach).all() and (box[1] < high + reach).all():
        return mesh
    near = ((mesh.vertices > low - reach) & (mesh.vertices < high + reach)).all(axis=1)
    away = ~near[mesh.faces].any(axis=1)
    areas = triangle_areas(mesh.triangles)
    if not away.any() or areas[away].sum() > _SCRAP_AREA * areas.sum():
        return mesh
    return mesh.only(~away).noted("OBJECT_POINTS_DROPPED", f"{int(away.sum())} stray triangles far away were left out.")
